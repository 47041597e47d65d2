"""report_data.h5: what report.html is made of besides recording.h5, so that `rig report` can make the page again.

/           attributes: format, version; identification: JSON, whose arrays stand beside it
/arrays/000 one array each, thinned nowhere: traces of the runs, histories of the genetic algorithm
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from identify.report.value_codec import AnyArray, Arrays, CodecError, decode, encode
from identify.results import Identification
from rig import effects
from rig.channels import Channel
from rig.errors import RecordingError
from rig.recording.h5_heaps import check_heaps
from rig.recording.memory import at_most

FILE = "report_data.h5"
FORMAT = "isp-rig report data"
REPORT_DATA_VERSION = 1  # of the format of this file
MAX_REPORT_VALUES = 60_000_000  # half a gigabyte; a longer campaign keeps no report data
MAX_REPORT_BYTES = 2 << 30  # of memory that reading may take
# What h5py and json raise over a damaged file; a link that leads nowhere reads as None.
_DAMAGE = (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, MemoryError, RecursionError)


@dataclass(frozen=True)
class ReportData:
    """Everything behind a report.

    Attributes
    ----------
    identification
        With the traces of all runs.
    name
        Of the campaign.
    runs
        Names of the runs of recording.h5 that were identified from: all, or those that came to their end.
    channels
        Measured channels as their effects were made from them.
    own_effects
        Effect of the user's own -> the file it was read from.
    """

    identification: Identification
    name: str
    runs: tuple[str, ...]
    channels: tuple[Channel, ...] = ()
    own_effects: dict[str, str] = field(default_factory=dict)


def report_data(identification: Identification, runs: tuple[str, ...], name: str) -> ReportData:
    """What a report of ``identification`` needs to be made again in another process."""
    read = [effects.get(effect).reads for effect in effects.known()]
    channels = tuple(dict.fromkeys(channel for channel in read if channel is not None))
    files = {effect: path for effect in effects.known() if (path := effects.file_of(effect)) is not None}
    return ReportData(identification, name, runs, channels, {effect: str(path) for effect, path in files.items()})


def image_of(data: ReportData) -> bytes | None:
    """The bytes of report_data.h5; None where the campaign is too long for it to be read back."""
    arrays = Arrays()
    text = json.dumps(encode(data, arrays))
    if sum(array.size for array in arrays.kept) > MAX_REPORT_VALUES:
        return None
    # Made in memory: on a full disk the HDF5 library crashes instead of raising.
    with h5py.File(FILE, "w", driver="core", backing_store=False) as file:
        file.attrs.update({"format": FORMAT, "version": REPORT_DATA_VERSION})
        file["identification"] = text
        group = file.create_group("arrays")
        for number, array in enumerate(arrays.kept):
            packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if array.size > 1000 else {}
            group.create_dataset(f"{number:03d}", data=array, **packed)
        file.flush()
        return bytes(file.id.get_file_image())


def read_report_data(path: Path) -> ReportData:
    """What was written.

    Raises
    ------
    RecordingError
        Where the file is damaged, not ours, or of another version.
    """
    try:
        check_heaps(path)
        with h5py.File(path, "r") as file, at_most(MAX_REPORT_BYTES):
            _check_format(path, file)
            text = _plain(path, file, "identification")[()]
            arrays = _arrays(path, file)
        return decode(ReportData, json.loads(text), arrays)
    except CodecError as error:
        raise RecordingError(
            f"{path}: was written by another version or is damaged ({error}): identify again"
        ) from None
    except _DAMAGE as error:
        raise RecordingError(f"{path}: is damaged ({error}): identify again from the recording") from error


def _check_format(path: Path, file: h5py.File) -> None:
    if file.attrs.get("format") != FORMAT:
        raise RecordingError(f"{path}: holds no report data: restore the file, or identify again")
    version = int(file.attrs["version"])
    if version != REPORT_DATA_VERSION:
        raise RecordingError(
            f"{path}: has version {version}, this program reads version {REPORT_DATA_VERSION}: "
            "use the version that wrote it"
        )


def _arrays(path: Path, file: h5py.File) -> list[AnyArray]:
    group, found, left = file["arrays"], [], MAX_REPORT_VALUES
    for name in sorted(group, key=int):
        dataset = _plain(path, group, name)
        left -= dataset.size
        if left < 0 or dataset.dtype.kind not in "fiub":
            raise RecordingError(f"{path}: arrays/{name} is too long or holds no numbers: identify again")
        found.append(np.asarray(dataset[()]))
    return found


def _plain(path: Path, group: Any, name: str) -> h5py.Dataset:
    """A dataset that stands in this file. Raises RecordingError for a link or one that is kept elsewhere."""
    data = group[name] if isinstance(group.get(name, getlink=True), h5py.HardLink) else None
    if not isinstance(data, h5py.Dataset) or data.external or data.is_virtual:
        raise RecordingError(f"{path}: {name!r} is not kept in the file itself: restore it, or identify again")
    return data
