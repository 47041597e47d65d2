"""The live view: a page on this machine that shows a campaign while it plays, served by a process of its own."""
