"""Images of people with cameras, masks and joints: packs and datasets."""
from __future__ import annotations

import copy
import json
import os
from typing import TYPE_CHECKING, Any, Callable, Iterable, Iterator, NamedTuple, Optional, Sequence, TypeVar, Union

import numpy as np

from mvstudio import _core
from mvstudio._error import Error
from mvstudio._rig import Rig

if TYPE_CHECKING:
    from mvstudio._torch import TorchSamples

PARTS = ("", "train", "validation", "test")
Self = TypeVar("Self", bound="Samples")


class Sample(NamedTuple):
    """One image of a person, and what is known of it.

    Attributes
    ----------
    image : ndarray, (h, w, 3), uint8
        RGB.
    mask : ndarray, (h, w), uint8, or None
        255: the person, 0: the background.
    camera : str
    frame : int
    person : int
        -1: nobody.
    part : str
        ``"train"``, ``"validation"``, ``"test"``, or ``""`` without a split.
    K : ndarray, (3, 3)
        Of this image, px; the centre of the top-left pixel is (0, 0).
    cam_from_world : ndarray, (4, 4)
        Of this image, metres. A crop's camera is turned towards the person.
    joints_in_world : ndarray, (19, 3)
        CMU Panoptic's joints, metres; NaN where there is none.
    joints_px : ndarray, (19, 2)
        In this image; NaN where not in view.
    """

    image: np.ndarray
    mask: Optional[np.ndarray]
    camera: str
    frame: int
    person: int
    part: str
    K: np.ndarray
    cam_from_world: np.ndarray
    joints_in_world: np.ndarray
    joints_px: np.ndarray


class _Source:
    """The reader in C++. Every process opens its own: what was open before a fork is left alone."""

    def __init__(self, opener: str, arguments: tuple[Any, ...]) -> None:
        self.opener, self.arguments = opener, arguments
        self._opened: Any = None
        self._table: dict[str, np.ndarray] = {}
        self._names: list[str] = []
        self._pid = 0
        self.reader()

    def reader(self) -> Any:
        if self._pid != os.getpid():
            self._opened, self._pid = getattr(_core, self.opener)(*self.arguments), os.getpid()
        return self._opened

    def table(self) -> dict[str, np.ndarray]:
        if not self._table:
            self._table = self.reader().table()
        return self._table

    def names(self) -> list[str]:
        if not self._names:
            self._names = Rig._of(self.reader().rig()).names
        return self._names

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return _Source, (self.opener, self.arguments)


class Samples:
    """Samples by their index: an iterable, with their columns as arrays. See `Pack` and `Dataset`.

    Attributes
    ----------
    camera_idx, frame, person : ndarray, (n,), int
        The camera's index in `cameras`; the frame's number; the person, -1: nobody.
    part : ndarray, (n,), str
        ``"train"``, ``"validation"``, ``"test"``, or ``""`` without a split.
    has_mask : ndarray, (n,), bool
    univ_time_ms : ndarray, (n,)
        Panoptic's clock; NaN where it is unknown.
    size_px : ndarray, (n, 2), int
        Width and height.
    K : ndarray, (n, 3, 3)
    cam_from_world : ndarray, (n, 4, 4)
    joints_in_world : ndarray, (n, 19, 3)
        Metres; NaN where there is none.
    confidence : ndarray, (n, 19)
    joints_px : ndarray, (n, 19, 2)
        NaN where not in view.
    """

    def __init__(self, opener: str, arguments: tuple[Any, ...]) -> None:
        self._source = _Source(opener, arguments)
        self._rows = np.arange(len(self._source.reader()))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        column = "camera" if name == "camera_idx" else name
        table = self._source.table()
        if column not in table or name == "camera":
            raise AttributeError(f"{type(self).__name__} has no {name!r}")
        values = table[column][self._rows]
        return np.array(PARTS)[values] if name == "part" else values

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._source.table(), "camera_idx"} - {"camera"})

    def __len__(self) -> int:
        return len(self._rows)

    def __repr__(self) -> str:
        return f"{type(self).__name__} of {len(self)} images, {len(self.cameras)} cameras, {len(set(self.frame))} frames"

    @property
    def cameras(self) -> list[str]:
        """The names of the dataset's cameras."""
        return list(self._source.names())

    @property
    def rig(self) -> Rig:
        """The dataset's cameras with their full lens models."""
        return Rig._of(self._source.reader().rig())

    @property
    def about(self) -> dict[str, Any]:
        """What the reader knows of the whole; of a pack, ``plan``: how it was made (docs/packs.md)."""
        about = dict(self._source.reader().about())
        return {**about, "plan": json.loads(about["plan"])} if isinstance(about.get("plan"), str) else about

    def _row(self, index: Any) -> int:
        number = range(len(self))[index]  # IndexError beyond the end, which ends a loop over the samples
        return int(self._rows[number])

    def image(self, index: int) -> np.ndarray:
        """(h, w, 3) uint8, RGB."""
        return self._source.reader().image(self._row(index))

    def mask(self, index: int) -> Optional[np.ndarray]:
        """(h, w) uint8, 255 where the person is, or None where the sample has no mask."""
        return self._source.reader().mask(self._row(index))

    def __getitem__(self, index: int) -> Sample:
        row, table = self._row(index), self._source.table()
        return Sample(self.image(index), self.mask(index), self._source.names()[table["camera"][row]], int(table["frame"][row]),
                      int(table["person"][row]), PARTS[table["part"][row]], table["K"][row], table["cam_from_world"][row],
                      table["joints_in_world"][row], table["joints_px"][row])

    def __iter__(self) -> Iterator[Sample]:
        return (self[index] for index in range(len(self)))

    def subset(self: Self, rows: Any = None, *, part: Union[str, Iterable[str], None] = None,
               cameras: Optional[Iterable[Union[str, int]]] = None, frames: Optional[Iterable[int]] = None) -> Self:
        """Some of the samples, in their order; what is open is shared.

        Parameters
        ----------
        rows : array_like of int or bool, or None
            Which of them; None: all.
        part : str, list of str or None
            Of the split: ``"train"``, ``"validation"``, ``"test"``.
        cameras : list of str or int, or None
        frames : iterable of int, or None

        Raises
        ------
        Error
            Where none is left.
        """
        keep = np.ones(len(self), dtype=bool)
        if part is not None:
            keep &= np.isin(self.part, [part] if isinstance(part, str) else list(part))
        if cameras is not None:
            keep &= np.isin(self.camera_idx, [self.rig.index(camera) for camera in cameras])
        if frames is not None:
            keep &= np.isin(self.frame, list(frames))
        chosen = np.arange(len(self))[keep] if rows is None else np.arange(len(self))[rows][keep[rows]]
        if len(chosen) == 0:
            there = ", ".join(sorted(set(self.part) - {""})) or "none: it was made without a split"
            raise Error("CLI-FRAMES", f"no sample is left of {len(self)}", f"parts: {there}; cameras: {', '.join(self.cameras)}")
        some = copy.copy(self)
        some._rows = self._rows[chosen]
        return some

    def to_frame(self) -> Any:
        """A pandas.DataFrame, a row a sample: camera, frame, person, part, has_mask."""
        import pandas
        return pandas.DataFrame({"camera": np.array(self.cameras, dtype=object)[self.camera_idx], "frame": self.frame,
                                 "person": self.person, "part": self.part, "has_mask": self.has_mask})

    def torch(self, *, masked: bool = False, transform: Optional[Callable[[dict[str, Any]], Any]] = None) -> TorchSamples:
        """The samples as a ``torch.utils.data.Dataset``; imports torch.

        Parameters
        ----------
        masked : bool
            Images as the trainer's batches hold them: float32 in [0, 1], black outside the mask, and masks in [0, 1].
        transform : callable or None
            Takes the dict of a sample; what it returns is the item. It must survive pickling where workers are spawned.

        Returns
        -------
        TorchSamples
            Items are dicts of tensors: ``image`` (3, h, w) uint8, ``mask`` (h, w) uint8 where all samples have one,
            ``joints_in_cam`` (19, 3) float32, metres, 0 where ``joint_valid`` (19) is false, ``intrinsics`` (4) float32:
            fx, fy, cx, cy, ``camera_idx`` and ``frame``. Each worker of a ``DataLoader`` opens the files itself.

        Notes
        -----
        The rows of ``AvatarPack`` (avatar/data/pack.h), from which `avatar train` learns.
        """
        from mvstudio._torch import TorchSamples
        return TorchSamples(self, masked, transform)


class Pack(Samples):
    """Images of `dataset pack`: crops or whole images in HDF5 files, read at random.

    Parameters
    ----------
    path : str or path
        A finished folder, one of its shards, or a single file.
    check : bool
        Whether structure and tables are first read in a process of their own, which a hostile file may bring down without harm.

    Examples
    --------
    >>> pack = mvstudio.Pack("PACK")                                    # doctest: +SKIP
    >>> for sample in pack.subset(part="train"):                        # doctest: +SKIP
    ...     print(sample.camera, sample.frame, sample.image.shape)
    >>> loader = torch.utils.data.DataLoader(pack.torch(), batch_size=8, num_workers=2)     # doctest: +SKIP

    Notes
    -----
    The format and what is guaranteed: docs/packs.md. Every image has a checksum that is checked when it is read.
    """

    def __init__(self, path: Any, *, check: bool = True) -> None:
        super().__init__("open_pack", (os.fspath(path), check))

    def image_bytes(self, index: int) -> bytes:
        """The encoded image as it is stored: PNG, JPEG, or rows of RGB (`about["codec"]`)."""
        return self._source.reader().image_bytes(self._row(index))


class Dataset(Samples):
    """Images of a dataset in CMU Panoptic's layout, cropped as `avatar train` and `dataset pack` crop them.

    Parameters
    ----------
    folder : str or path
        Of `dataset build`, or a sequence of CMU's.
    crop : int
        Edge of the square crops, px; 0: whole images through their own lens.
    split : str, path or None
        File of `dataset split`: only its images, each with its part.
    person : int
        -1: the one whom most frames show.
    masks : bool
        Whether masks are read; then images without one are left out.
    fill : float
        Share of a crop that the person's largest poses (98 % quantile) fill.
    half_extent_m : float
        Metres from a crop's centre that `fill` stands for; 0: by the person's poses.

    Notes
    -----
    Each access decodes a whole image. What is read again and again belongs into a pack (docs/packs.md). Training leaves out
    crops whose mask has fewer than 16 px; they are samples here.
    """

    def __init__(self, folder: Any, *, crop: int = 128, split: Any = None, person: int = -1, masks: bool = True,
                 fill: float = 0.97, half_extent_m: float = 0.0) -> None:
        super().__init__("open_dataset", (os.fspath(folder), crop, fill, half_extent_m, person, masks,
                                          "" if split is None else os.fspath(split)))
