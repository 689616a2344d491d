"""Synthetic frames for still pictures, and pictures read back as pixel values."""

from types import SimpleNamespace

import numpy as np

import sand

R = 1e-8


class Frame(SimpleNamespace):
    """The attributes of a frame that a picture needs."""

    def __len__(self):
        return len(self.radius)


def frame_of(position, pairs=(), radius=R, box=None, **more):
    """A frame of iron grains; normal forces of 1 nN, one mode of each contact at its limit."""
    position = np.array(position, float)
    count, pair = len(position), np.array(pairs, dtype=np.uint32).reshape(-1, 2)
    zeros = np.zeros((count, 3))
    box = box or sand.Box.open()
    way = box.nearest(position[pair[:, 0]] - position[pair[:, 1]])
    usual = {
        "position": position,
        "radius": np.broadcast_to(radius, count).astype(float),
        "velocity": zeros,
        "spin": zeros,
        "moment": zeros,
        "mass": np.full(count, 3e-20),
        "material": np.zeros(count, int),
        "materials": ["iron"],
        "pair": pair,
        "force": 1e-9 * way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300),
        "share": np.tile([-2.0, 1.0, 0.2, 0.1], (len(pair), 1)),
        "box": box,
        "time": 1e-6,
    }
    return Frame(**(usual | more))


def at_pixel(picture, point):
    """Column and row (from below) of a point [m] in pixels, parallel projection."""
    flat = picture.rotation @ point
    left, right, bottom, top = picture.window
    height, width = picture.grains_only.shape[:2]
    return (flat[0] - left) / (right - left) * width, (flat[1] - bottom) / (top - bottom) * height


def pixels_of_hue(picture, colour, least=0.5):
    """Mask (H, W) of the pixels with the hue of a colour (direction of the difference from grey)."""
    rest = picture[..., :3] - picture[..., :3].mean(axis=2, keepdims=True)
    hue = np.asarray(colour) - np.mean(colour)
    size = np.linalg.norm(rest, axis=2) * np.linalg.norm(hue)
    return (picture[..., 3] > 0.5) & ((rest @ hue) > 0.97 * size) & (np.linalg.norm(rest, axis=2) > least * 0.1)
