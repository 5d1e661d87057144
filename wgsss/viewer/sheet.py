"""Pictures where the user interface can show them."""

from __future__ import annotations

from typing import Any

import numpy as np

from wgsss.gpu import Gpu


class Sheet:
    """A texture of the user interface. Its texels are encoded as they are: sampled as sRGB they would be decoded."""

    def __init__(self, gpu: Gpu, backend: Any) -> None:
        self._gpu, self._backend = gpu, backend
        self._texture: Any = None
        self.reference: Any = None
        """what the user interface calls it; None: nothing is on it"""

    def show(self, texture: Any) -> None:
        """Copy an rgba8unorm-srgb texture."""
        self._fit(texture.size[:2])
        encoder = self._gpu.device.create_command_encoder()
        encoder.copy_texture_to_texture({"texture": texture}, {"texture": self._texture}, texture.size)
        self._gpu.queue.submit([encoder.finish()])

    def write(self, pixels: np.ndarray) -> None:
        """Copy uint8 (H, W, 4)."""
        height, width = pixels.shape[:2]
        self._fit((width, height))
        layout = {"bytes_per_row": 4 * width, "rows_per_image": height}
        where = {"texture": self._texture}
        self._gpu.queue.write_texture(where, np.ascontiguousarray(pixels), layout, (width, height, 1))

    def clear(self) -> None:
        if self.reference is not None:
            self._backend.unregister_texture(self.reference)
            self._texture.destroy()
        self._texture = self.reference = None

    def _fit(self, size: tuple[int, int]) -> None:
        import wgpu

        if self._texture is not None and self._texture.size[:2] == tuple(size):
            return
        self.clear()
        usage = wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST
        self._texture = self._gpu.device.create_texture(size=(*size, 1), format="rgba8unorm", usage=usage)
        self.reference = self._backend.register_texture(self._texture.create_view())
