"""Settings that a model is prepared with: its hollows, the views of them, and spheres in clouds."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class SphereSettings:
    """Where a socket's centre lies in a cloud (Fischler and Bolles 1981, with the soft count of MSAC)."""

    hypotheses: int = 800
    """Triples of points tried."""

    max_centres: int = 3
    """Centres returned at most."""

    width_mm: float = 0.8
    """Scale of the consensus."""

    settling_widths_mm: tuple[float, ...] = (1.5, 1.0, 0.8, 0.8)
    """Scale of the weights in each step of the reweighted least squares that settles a centre."""

    apart_mm: float = 1.5
    """Centres nearer than this count as one."""

    judged_points: int = 400
    """Points that hypotheses are judged on."""

    settling_points: int = 700
    """Points that a centre is settled on."""

    settled_hypotheses: int = 40
    """Hypotheses, the best first, that are settled at most."""

    min_triple_share: float = 0.3
    """Smallest area of the parallelogram of a triple, in squared radii: smaller ones do not hold a sphere."""

    ridge: float = 1e-6
    """Stiffness (points) that holds a centre along directions that no point tells of."""


@dataclass(frozen=True)
class HollowSettings:
    """Hollow, nearly spherical regions of a model, by a Hough vote for centre and radius (Ballard 1981)."""

    min_radius_mm: float = 14.0
    """Smallest radius of a joint socket that is looked for."""

    max_radius_mm: float = 36.5
    """Largest radius of a joint socket that is looked for."""

    radius_step_mm: float = 1.5
    """Step between the radii voted for."""

    radius_leeway: float = 0.2
    """A fitted radius may lie outside these limits by this share of them."""

    cell_mm: float = 3.0
    """Cell of the vote count."""

    max_faces: int = 10_000
    """Of larger models so many faces, evenly taken, vote."""

    min_faces: int = 30
    """Fewer faces on a sphere are chance."""

    peaks_per_radius: int = 4
    """Cells with the most votes that are taken of each radius."""

    peaks_per_hollow: int = 4
    """Peaks fitted for each hollow that may be returned."""

    peaks_apart_cells: float = 2.0
    """Peaks nearer than this are one."""

    near_mm: float = 5.0
    """Faces within this of a peak's sphere take part in hypotheses."""

    near_cosine: float = 0.7
    """Their normals point to its centre within the angle of this cosine: 46 deg."""

    hypotheses: int = 400
    """Spheres tried about each peak."""

    max_change_mm: float = 8.0
    """A hypothesis may lie so far from its peak, in centre and in radius."""

    judged_points: int = 1000
    """Points that hypotheses are judged on."""

    judged_width_mm: float = 0.7
    """Scale of that consensus."""

    fit_passes: int = 5
    """Passes of least squares on the points of the sphere that the last pass found."""

    on_mm: float = 1.0
    """Faces within this of the sphere lie on it."""

    on_cosine: float = 0.85
    """Their normals point to its centre within the angle of this cosine: 32 deg."""

    max_hollows: int = 3
    """Hollows returned at most, the largest first."""

    min_area_share: float = 0.5
    """Hollows with a smaller share of the largest one's area are left out."""

    apart_radii: float = 0.5
    """Hollows whose centres are nearer than this, in radii, are one."""


@dataclass(frozen=True)
class ViewSettings:
    """What a scanner in front of a region sees of it, and the distance fields of that."""

    shell_cone_deg: float = 30.0
    """A shell holds what can be seen from directions within this angle of the view's axis."""

    min_seen_cosine: float = 0.02
    """Faces seen flatter than this return no echo."""

    reach_mm: float = 26.0
    """How far beyond the socket's sphere the fields reach: the rim and its surroundings are scanned too."""

    margin_mm: float = 10.0
    """Room about the bone, so that tissue in front of it lies inside the fields."""

    field_step_mm: float = 1.0
    """Step of the fine field; the coarse one has twice that. A step of 1 mm errs by 0.03 mm rms near bone."""

    field_band_mm: float = 1.75
    """Half width of the band about the surface in which the fine nodes are exact; twice that for the coarse ones."""

    whole_steps: int = 90
    """Steps along the longest edge of a whole model's field, where that makes them longer than `field_step_mm`."""

    whole_nodes: int = 1_500_000
    """Nodes of the fine field of a whole model, made where no hollow explains the points: 1.5 mm on a femur."""

    opening_rays: int = 400
    """Directions that a socket's opening is sought along."""

    opening_radii: float = 2.5
    """A direction is free when the model is farther away that way than so many radii."""

    opening_min_directions: float = 1.0
    """Where the free directions sum to a shorter vector, the socket's own axis stands in."""

    seen_radii: float = 1.2
    """A socket's scan reaches so many radii from its centre."""

    seen_min_cosine: float = 0.1
    """Faces of a socket seen flatter than this have no part in its sphere."""

    seen_points: int = 1500
    """Points drawn from a model to see it as a scan does."""

    radius_factors: tuple[float, ...] = (0.92, 0.96, 1.0, 1.04, 1.08)
    """Radii tried for the sphere that a scan shows, as shares of that of the socket's fit."""

    max_centre_shift_radii: float = 0.5
    """The centre of that sphere may lie so far from that of the socket's fit, in radii."""

    cell_mm: float = 20.0
    """Starts that look at places nearer than this share a view."""

    directions: int = 120
    """Directions that starts' views are seen along, some 18 deg apart."""


@dataclass(frozen=True)
class PreparationSettings:
    """Settings of :func:`picoradar.registration.prepare_model`."""

    hollow: HollowSettings = field(default_factory=HollowSettings)
    view: ViewSettings = field(default_factory=ViewSettings)
    sphere: SphereSettings = field(default_factory=SphereSettings)
