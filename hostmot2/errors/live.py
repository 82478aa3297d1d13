"""What can go wrong with a live view."""

from __future__ import annotations

from hostmot2.errors.base import HostMot2Error


class LiveError(HostMot2Error):
    """The live view's server cannot listen at that address."""

    code = "HM2-E114"
    causes = (
        "another program listens at that port: another live view, or the viewer's own bridge",
        "the host is no address of this computer, or its name is not known",
    )
    fix = "Take another port (0: any free one) or end what listens there; host is one of this computer's."
