"""Video beside a track: its place in the track's time, from the picture's motion or a clap, and a calibrated camera.

`oarlock calibrate video` and `oarlock view --video` use it. Reading videos needs the package `av`.
"""

from __future__ import annotations

from oarlock.movement.video.alignment import OffsetCandidate, VideoAlignment, align
from oarlock.movement.video.body_motion import body_motion, motion_of_places
from oarlock.movement.video.camera import Camera, load_camera
from oarlock.movement.video.clap import ClapOffset, clap_offset
from oarlock.movement.video.drift import with_drift
from oarlock.movement.video.picture_motion import picture_motion
from oarlock.movement.video.reading import VideoInfo, sound_of, video_info

__all__ = [
    "Camera",
    "ClapOffset",
    "OffsetCandidate",
    "VideoAlignment",
    "VideoInfo",
    "align",
    "body_motion",
    "clap_offset",
    "load_camera",
    "motion_of_places",
    "picture_motion",
    "sound_of",
    "video_info",
    "with_drift",
]
