"""Films: pictures written as MP4 or WebM, by ffmpeg, or as GIF."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path

from PIL import Image

from ..basics.errors import BadInput
from ..io.run_folder import replace_by_copy

ENCODERS = {
    ".mp4": ("-c:v", "libx264", "-crf", "18", "-movflags", "+faststart"),
    ".webm": ("-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1"),
}
"""Arguments of ffmpeg by ending: constant quality, at which edges of grains show no artefacts."""
COLOURS = (
    *(
        "-vf",
        "scale=out_color_matrix=bt709:out_range=tv:flags=bicubic+accurate_rnd+full_chroma_int",
        "-pix_fmt",
        "yuv420p",
    ),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"),
)
"""Colours as players expect them: without these arguments blues and oranges are shifted."""
GIF = ".gif"
ENDINGS = (*ENCODERS, GIF)


def find_ffmpeg() -> str | None:
    """Path of the system's ffmpeg, or of that of the package imageio-ffmpeg; None if there is none."""
    if path := shutil.which("ffmpeg"):
        return path
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        return None


def check_film(path: Path, size: tuple[int, int]) -> None:
    """Check that a film can be written.

    Raises
    ------
    BadInput
        If the ending is unknown, ffmpeg is needed and missing, or the size is odd where colours need pairs of pixels.
    """
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise BadInput(f"--movie {path}: the name of a film must end in {', '.join(ENDINGS)}, such as {path.stem}.mp4")
    if ending == GIF:
        return
    if size[0] % 2 or size[1] % 2:
        even = "x".join(str(length + length % 2) for length in size)
        raise BadInput(f"--size {size[0]}x{size[1]}: width and height of {ending} must be even, such as {even}")
    if find_ffmpeg() is None:
        raise BadInput(
            f"{path.name} needs ffmpeg, which is not there: install it, or pip install imageio-ffmpeg; "
            f"{path.stem}.gif needs none"
        )


def write_film(path: Path, pictures: Iterable[Image.Image], size: tuple[int, int], rate: int) -> int:
    """Write a film; the file appears when it is complete.

    Parameters
    ----------
    path : Path
        The file; its ending is one of ENDINGS.
    pictures : iterable of Image
        Pictures in RGB, all of this size.
    size : tuple of int
        Width and height [pixels]; even, except for GIF.
    rate : int
        Frames per second. A GIF counts in hundredths of a second, to which the time of a frame is rounded.

    Returns
    -------
    int
        Size of the file [bytes].

    Raises
    ------
    BadInput
        If ffmpeg refuses.
    FilesFailed
        If the file cannot be written.
    """
    ending = path.suffix.lower()
    with tempfile.TemporaryDirectory(prefix="sand-") as place:
        film = Path(place, f"film{ending}")
        if ending == GIF:
            _write_gif(film, pictures, rate)
        else:
            _encode(film, pictures, size, rate)
        replace_by_copy(path, film)
        return film.stat().st_size


def _write_gif(film: Path, pictures: Iterable[Image.Image], rate: int) -> None:
    reduced = (picture.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE) for picture in pictures)
    time = 10 * max(round(100 / rate), 1)  # ms
    next(reduced).save(film, save_all=True, append_images=reduced, duration=time, loop=0)


def _encode(film: Path, pictures: Iterable[Image.Image], size: tuple[int, int], rate: int) -> None:
    """Give the pictures to ffmpeg, one by one."""
    raw = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", str(rate), "-i", "-")
    command = [str(find_ffmpeg()), "-v", "error", *raw, *ENCODERS[film.suffix], *COLOURS, "-y", str(film)]
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log)
        assert process.stdin is not None
        try:
            for picture in pictures:
                process.stdin.write(picture.tobytes())
            process.stdin.close()
            failed = process.wait() != 0
        except BrokenPipeError:
            failed = True
        finally:  # also if the user interrupts it
            process.kill()
            process.wait()
        if failed:
            log.seek(0)
            lines = log.read().decode("utf-8", "replace").split("\n")
            why = next((line.strip() for line in lines if line.strip()), "it does not say why")
            raise BadInput(f"ffmpeg could not write {film.suffix}: {why}; a .gif needs no ffmpeg")
