"""Bodies of revolution: a spherical nose tangent to a row of conical and cylindrical segments."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sim.core.checks import check_fields, check_numbers
from sim.core.errors import InputError
from sim.core.quadrature import dot, gauss_legendre

__all__ = ["BodyShape", "Frustum", "Segment", "cone", "cylinder", "flare", "sphere_cone"]

Floats = NDArray[np.float64]
Kind = Literal["cone", "cylinder", "flare"]

# Gauss-Legendre rule that integrates every polynomial up to degree 9 exactly: volumes and inertias are.
_NODES, _WEIGHTS = gauss_legendre(5)


@dataclass(frozen=True)
class Segment:
    """One straight piece of the outline behind the nose.

    Parameters
    ----------
    kind : {"cone", "cylinder", "flare"}
        Pressure laws are chosen by kind. Cone and flare have the same geometry: a cone is part of the
        forebody, a flare stands behind a slimmer part.
    length_m : float
        Axial length, > 0. The first segment's counts from its tangent point on the spherical nose.
    half_angle_deg : float
        Slope of the outline, -90 < angle < 90; negative for a boat tail, 0 for a cylinder.
    """

    kind: Kind
    length_m: float
    half_angle_deg: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.length_m > 0.0:
            raise InputError(f"{self.kind} length must be positive, got {self.length_m:g} m")
        if not abs(self.half_angle_deg) < 90.0:
            raise InputError(f"{self.kind} half-angle must lie within +-90 deg, got {self.half_angle_deg:g}")
        if self.kind == "cylinder" and self.half_angle_deg != 0.0:
            raise InputError(f"a cylinder has no half-angle, got {self.half_angle_deg:g} deg")


def cone(half_angle_deg: float, length_m: float) -> Segment:
    """Conical part of the forebody."""
    return Segment("cone", length_m, half_angle_deg)


def cylinder(length_m: float) -> Segment:
    """Cylindrical part."""
    return Segment("cylinder", length_m)


def flare(half_angle_deg: float, length_m: float) -> Segment:
    """Conical skirt behind a slimmer part."""
    return Segment("flare", length_m, half_angle_deg)


@dataclass(frozen=True)
class Frustum:
    """A segment in place: where it starts and ends, x aft from the nose tip, r radius, s arc length."""

    kind: Kind
    angle_rad: float
    x0_m: float
    r0_m: float
    s0_m: float
    x1_m: float
    r1_m: float
    s1_m: float


@dataclass(frozen=True)
class BodyShape:
    """Outline of a body of revolution, closed by a flat base.

    Parameters
    ----------
    nose_radius_m : float
        Radius of the sphere, >= 0; with 0 the first segment must be a cone and starts at its apex.
    segments : tuple of Segment
        In order from the nose; none at all leaves a spherical cap.
    cap_angle_deg : float
        Slope at which a body without segments ends: 0 for a hemisphere.

    Raises
    ------
    InputError
        When the outline closes on the axis or the nose cannot be tangent to the first segment.
    """

    nose_radius_m: float
    segments: tuple[Segment, ...] = ()
    cap_angle_deg: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.nose_radius_m >= 0.0:
            raise InputError(f"nose radius must not be negative, got {self.nose_radius_m:g} m")
        if self.nose_radius_m == 0.0 and not (self.segments and self.segments[0].half_angle_deg > 0.0):
            raise InputError("a pointed body (nose radius 0) must start with a cone that opens backwards")
        for number, part in enumerate(self.frusta, start=1):
            if not (part.r0_m >= 0.0 and part.r1_m > 0.0):
                raise InputError(
                    f"segment {number} ({part.kind}) closes on the axis: radius {part.r1_m:.4g} m at its end"
                )

    @property
    def nose_angle_rad(self) -> float:
        """Slope at which the spherical nose ends."""
        return math.radians(self.segments[0].half_angle_deg if self.segments else self.cap_angle_deg)

    @property
    def tangent_point_m(self) -> tuple[float, float]:
        """Axial position and radius of the end of the spherical nose."""
        angle = self.nose_angle_rad
        return self.nose_radius_m * (1.0 - math.sin(angle)), self.nose_radius_m * math.cos(angle)

    @cached_property
    def frusta(self) -> tuple[Frustum, ...]:
        """The segments with their positions."""
        x, r = self.tangent_point_m
        s = self.nose_radius_m * (0.5 * math.pi - self.nose_angle_rad)
        parts = []
        for segment in self.segments:
            angle = math.radians(segment.half_angle_deg)
            x1 = x + segment.length_m
            r1 = r + segment.length_m * math.tan(angle)
            s1 = s + segment.length_m / math.cos(angle)
            parts.append(Frustum(segment.kind, angle, x, r, s, x1, r1, s1))
            x, r, s = x1, r1, s1
        return tuple(parts)

    @property
    def length_m(self) -> float:
        """From the nose tip to the base."""
        return self.frusta[-1].x1_m if self.frusta else self.tangent_point_m[0]

    @property
    def base_radius_m(self) -> float:
        """Radius of the flat base."""
        return self.frusta[-1].r1_m if self.frusta else self.tangent_point_m[1]

    @property
    def largest_radius_m(self) -> float:
        """Radius of the largest section, which is not the base of a body with a boat tail."""
        beyond = [part.r1_m for part in self.frusta]
        widest = self.nose_radius_m if self.nose_angle_rad < 0.0 else self.tangent_point_m[1]
        return max([widest, *beyond])

    @property
    def base_area_m2(self) -> float:
        """Area of the flat base."""
        return math.pi * self.base_radius_m**2

    @cached_property
    def volume_m3(self) -> float:
        """Volume enclosed by the outline and the base."""
        return self.integrate(lambda x, r2: math.pi * r2)

    @cached_property
    def centroid_m(self) -> float:
        """Centre of volume, aft of the nose tip."""
        return self.integrate(lambda x, r2: math.pi * r2 * x) / self.volume_m3

    def integrate(self, density: Callable[[Floats, Floats], Floats]) -> float:
        """Integral over the axis of a polynomial ``density(x, r**2)``, exact up to degree 9 in x."""
        length = self.tangent_point_m[0]
        x = length * _NODES
        total = length * dot(_WEIGHTS, density(x, x * (2.0 * self.nose_radius_m - x)))
        for part in self.frusta:
            length = part.x1_m - part.x0_m
            x = part.x0_m + length * _NODES
            r2 = (part.r0_m + math.tan(part.angle_rad) * (x - part.x0_m)) ** 2
            total += length * dot(_WEIGHTS, density(x, r2))
        return total

    def outline(self, points_per_part: int = 30) -> tuple[Floats, Floats]:
        """Coordinates of the meridian from the nose tip to the rim of the base.

        Parameters
        ----------
        points_per_part : int
            Points on the nose (equally spaced in slope angle) and on every segment, ends included.

        Returns
        -------
        x_m, r_m : ndarray, shape (n,)
            Axial position aft of the nose tip, and radius; both start at 0.
        """
        slope = np.linspace(0.5 * math.pi, self.nose_angle_rad, points_per_part)
        x = [self.nose_radius_m * (1.0 - np.sin(slope))]
        r = [self.nose_radius_m * np.cos(slope)]
        r[0][0] = 0.0
        for part in self.frusta:
            x.append(np.linspace(part.x0_m, part.x1_m, points_per_part)[1:])
            r.append(np.linspace(part.r0_m, part.r1_m, points_per_part)[1:])
        return np.concatenate(x), np.concatenate(r)

    def radius_m(self, x_m: float) -> float:
        """Radius of the outline at an axial position on the body."""
        if not 0.0 <= x_m <= self.length_m:
            raise InputError(f"x = {x_m:g} m lies outside the body (0 to {self.length_m:g} m)")
        for part in self.frusta:
            if x_m >= part.x0_m and x_m <= part.x1_m:
                return part.r0_m + (x_m - part.x0_m) * math.tan(part.angle_rad)
        return math.sqrt(x_m * (2.0 * self.nose_radius_m - x_m))


def sphere_cone(half_angle_deg: float, nose_radius_m: float, base_radius_m: float) -> BodyShape:
    """Spherically blunted cone; sharp with nose radius 0, a bare cap when its tangent point is the base."""
    check_numbers(half_angle_deg=half_angle_deg, nose_radius_m=nose_radius_m, base_radius_m=base_radius_m)
    angle = math.radians(half_angle_deg)
    room = base_radius_m - nose_radius_m * math.cos(angle)
    if not 0.0 < half_angle_deg < 90.0:
        raise InputError(f"cone half-angle must lie between 0 and 90 deg, got {half_angle_deg:g}")
    if abs(room) < 1e-6 * base_radius_m:
        return BodyShape(nose_radius_m, cap_angle_deg=half_angle_deg)
    if not room > 0.0:
        raise InputError(
            f"the nose is wider than the base: its tangent point has radius "
            f"{nose_radius_m * math.cos(angle):.4g} m, the base {base_radius_m:.4g} m"
        )
    return BodyShape(nose_radius_m, (cone(half_angle_deg, room / math.tan(angle)),))
