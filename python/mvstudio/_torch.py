"""Samples for PyTorch. Imported by `Samples.torch` alone."""
from __future__ import annotations

from typing import Any, Callable, Optional

import numpy as np
import torch
import torch.utils.data

from mvstudio._samples import Samples


class TorchSamples(torch.utils.data.Dataset):  # type: ignore[misc,type-arg,unused-ignore]
    """Samples by their index, as dicts of tensors; see `Samples.torch`."""

    def __init__(self, samples: Samples, masked: bool = False,
                 transform: Optional[Callable[[dict[str, Any]], Any]] = None) -> None:
        self.samples, self.masked, self.transform = samples, masked, transform
        self._has_masks = bool(samples.has_mask.all())
        if masked and not self._has_masks:
            from mvstudio._error import Error
            raise Error("CLI-USAGE", "`masked`: some samples have no mask", "take a subset of those where `has_mask` is true")
        cams = np.einsum("nij,nkj->nki", samples.cam_from_world[:, :3, :3], np.nan_to_num(samples.joints_in_world))
        cams += samples.cam_from_world[:, None, :3, 3]
        valid = np.isfinite(samples.joints_in_world).all(axis=-1) & (cams[..., 2] > 0)
        self._joints = torch.from_numpy(np.where(valid[..., None], cams, 0).astype(np.float32))
        self._valid = torch.from_numpy(valid)
        K = samples.K
        self._intrinsics = torch.from_numpy(np.stack([K[:, 0, 0], K[:, 1, 1], K[:, 0, 2], K[:, 1, 2]], axis=1).astype(np.float32))
        self._camera, self._frame = torch.from_numpy(samples.camera_idx), torch.from_numpy(samples.frame)

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: int) -> Any:
        image = torch.from_numpy(np.ascontiguousarray(self.samples.image(index).transpose(2, 0, 1)))
        item = {"image": image, "joints_in_cam": self._joints[index], "joint_valid": self._valid[index],
                "intrinsics": self._intrinsics[index], "camera_idx": self._camera[index], "frame": self._frame[index]}
        if self._has_masks:
            item["mask"] = torch.from_numpy(self.samples.mask(index))
        if self.masked:
            item["mask"] = item["mask"].to(torch.float32) / 255
            item["image"] = image.to(torch.float32) / 255 * item["mask"]
        return item if self.transform is None else self.transform(item)
