"""The HostMot2 modules of a card, a file each; the table of who answers for what is hostmot2/parts.py."""
