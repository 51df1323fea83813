"""A window without a border that shows frames pixel by pixel."""

import time
import tkinter
from pathlib import Path

from PIL import Image, ImageTk

from planning.model.errors import InputError

_STEP_S = 0.02


class StoppedError(Exception):
    """The user pressed Escape."""


class FrameWindow:
    """Covers a part of the desktop, at a place and of a size in its pixels.

    Raises:
        InputError: If there is no desktop, or it doesn't hold the frames.
    """

    def __init__(self, at: tuple[int, int], size: tuple[int, int]) -> None:
        try:
            self._root = root = tkinter.Tk()
        except tkinter.TclError as error:
            raise InputError(
                f"no window can be opened ({error}); run on the machine whose screen "
                f"is the projector, or show the files of patterns/ by other means"
            ) from None
        # The virtual desktop spans all screens.
        desktop = root.winfo_vrootwidth(), root.winfo_vrootheight()
        if at[0] + size[0] > desktop[0] or at[1] + size[1] > desktop[1]:
            root.destroy()
            raise InputError(
                f"frames of {size[0]} x {size[1]} px at {at[0]},{at[1]} don't fit the "
                f"desktop of {desktop[0]} x {desktop[1]} px; set the projector to its "
                f"own resolution, without scaling, and --at to its corner"
            )
        root.overrideredirect(True)
        root.geometry(f"{size[0]}x{size[1]}+{at[0]}+{at[1]}")
        root.configure(background="black", cursor="none")
        self._size = size
        self._image: ImageTk.PhotoImage | None = None
        self._label = tkinter.Label(root, borderwidth=0, background="black")
        self._label.place(x=0, y=0)
        self._keys: list[str] = []
        root.bind("<Key>", lambda event: self._keys.append(event.keysym))
        root.attributes("-topmost", True)
        root.focus_force()
        root.wait_visibility()

    def show(self, path: Path) -> None:
        """Show a frame.

        Raises:
            InputError: If it isn't an image of the window's size.
        """
        try:
            with Image.open(path) as image:
                image.load()
        except OSError as error:
            raise InputError(f"{path}: can't be shown ({error})") from None
        if image.size != self._size:
            raise InputError(
                f"{path}: {image.size[0]} x {image.size[1]} px, the projector has "
                f"{self._size[0]} x {self._size[1]}; write the patterns again"
            )
        self._image = ImageTk.PhotoImage(image, master=self._root)
        self._label.configure(image=self._image)
        self._root.update()
        # An answer from the screen says that it drew what was sent before.
        self._root.winfo_pointerxy()

    def wait(self, seconds: float | None) -> None:
        """Let a frame stand; None: until a key is pressed.

        Raises:
            StoppedError: If Escape is pressed meanwhile.
        """
        end = None if seconds is None else time.monotonic() + seconds
        self._keys.clear()
        while True:
            self._root.update()
            if "Escape" in self._keys:
                raise StoppedError
            if self._keys if end is None else time.monotonic() >= end:
                return
            time.sleep(_STEP_S)

    def close(self) -> None:
        """Give the screen back."""
        self._root.destroy()
