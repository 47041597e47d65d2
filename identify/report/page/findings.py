"""The verdict's sentences below the first screen: what that has said already is not said again."""

from __future__ import annotations

from identify.conclude.headline import headline
from identify.results import Identification
from identify.wording import capital, joined, plain


def further_findings(found: Identification) -> list[str]:
    """Every sentence of the verdict, without names, numbers and errors of J, C and K that stand above."""
    named = [plain(name) for name in found.verdict.effects]
    above = " ".join(headline(found))
    if not named:
        return [s for s in found.verdict.sentences if s not in above]
    heads = {f"The model lacked {name} (": name for name in named if f"{name} (" in above}
    errors = f"Without {joined(named)} in the model, "
    said_errors = "; without it, " in above
    out = []
    for sentence in found.verdict.sentences:
        name = next((name for head, name in heads.items() if sentence.startswith(head)), None)
        if name is not None:
            _, _, rest = sentence.partition("). ")
            out += [f"{capital(name)}: {rest[:1].lower()}{rest[1:]}"] if rest else []
        elif not (said_errors and sentence.startswith(errors)):
            out.append(sentence)
    return out
