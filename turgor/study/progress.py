"""How a study tells its caller where it is."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Receives the stages of a study and the part of the load that is reached."""

    def stage(self, name: str) -> None:
        """Name what begins now."""
        ...

    def note(self, text: str) -> None:
        """Tell a detail that the next one replaces, such as an iteration."""
        ...

    def tell(self, text: str) -> None:
        """Say what is worth knowing."""
        ...

    def warn(self, text: str) -> None:
        """Say what the user should know before going on."""
        ...

    def advance(self, fraction: float, text: str) -> None:
        """Tell the part of the load that is reached and kept, 0 to 1, and what was reached."""
        ...


class Silent:
    """Receives everything and shows nothing."""

    def stage(self, name: str) -> None:
        """Do nothing."""

    def note(self, text: str) -> None:
        """Do nothing."""

    def tell(self, text: str) -> None:
        """Do nothing."""

    def warn(self, text: str) -> None:
        """Do nothing."""

    def advance(self, fraction: float, text: str) -> None:
        """Do nothing."""
