"""Settings of a registration that follows a scan line by line."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LiveSettings:
    """When a pose is looked for, and when the one that is followed is given up."""

    min_points: int = 100
    """With fewer points no search is tried: they are fewer than one stage of the search takes."""

    min_width_mm: float = 2.0
    """Standard deviation of the points across their longest direction: a few lines side by side hold no rotation."""

    min_relief_mm: float = 1.0
    """Standard deviation of the points out of their plane: on a plane three motions are free."""

    retry_growth: float = 1.25
    """After a search the points grow by this factor before the next one, so that all together cost a few searches."""

    again_growth: float = 2.0
    """The same for a pose that fails, but that a search has led to again: another one would, too."""

    follow_growth: float = 1.1
    """The pose is refined when the points have grown by this factor: that takes a twentieth off its errors."""

    followed_points: int = 1500
    """The pose follows about so many points, evenly spread: as many as the candidates of a search are compared on."""

    casts: int = 1
    """Times that the beams are cast for a line: from line to line the pose moves by less than the noise."""

    walk_growth: float = 1.25
    """The weak mode is walked anew when the points have grown by this factor."""

    watched_points: int = 300
    """A rival is compared with the pose on so many points."""

    watched_nats: float = 60.0
    """Rivals are watched whose total log likelihood was within this of the pose's: what a beam fit may change."""

    least_explained: float = 0.5
    """A new line is explained when it has this share of the inliers that the points before it lead to expect."""

    unexplained_lines: int = 2
    """After so many lines in a row that are not, the pose is looked for anew: one may lie on a retractor."""

    steady_lines: int = 3
    """A verdict is reached when so many lines in a row have led to it: one look in many is lucky by chance."""
