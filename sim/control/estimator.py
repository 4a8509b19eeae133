"""Errors of sensors and wheels, estimated from measurements while contacts are closed.

With closed contacts, object i stands at its place X_i on the plate. Its measured pose at t is

    z_i(t) = C P(t - tau; s_v, c, s_w) X_i B_i + noise.

P is the pose of the plate by commands or odometry. Its motions are scaled by 1 + s_v in translation and 1 + s_w in
rotation, and drift sideways by c times the distance. C is the true start of the plate, B_i the measurement bias of
object i. All are constants without process noise, so they cannot explain a slip. Gauss-Newton finds the most likely
ones, with priors, and Student's t for outliers. A value without information keeps its prior and is reported as not
observable yet.

Scales and drift belong to the wheels' frame (`Pusher.wheels_pose`). In a frame at a lateral distance d, a turn by
theta would seem to be s_v d theta longer: 6 mm for 3 %, 0.2 m and 1 rad, which no constant explains.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pushplan.geometry.se2 import between, chained, compose, exp, inverse, log, relative, rotate, twist_of, wrap_angle
from pushplan.sim.control.sensing import NOISY, noise_between
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.control.values import COMMON, DELAY, NAMES, OWN, START_THETA, WHEELS, errors_in_words
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

ROOM = 320
"""Largest number of samples; beyond it, every second one of the older half is dropped."""
HOLD = 0.4
"""Smallest age of a sample in a fit, s; a departure is thus noticed before the fit can explain it."""
FREEDOM = 4.0
"""Degrees of freedom of Student's t."""
MODEL = (3e-4, 1e-3)
"""Smallest standard deviations of the model's error, m and rad."""
STEPS = np.array([1e-5, 1e-5, 1e-5, 1e-4, 1e-5, 1e-5, 1e-5])
"""Steps of finite differences."""
KNOT = 10
"""Number of recorded plate poses between two knots from which the motion is integrated."""
PINNED = 1e6
"""Factor of the prior precision that fixes a value."""
KNOWN = 1.0 / 3.0
"""Largest standard deviation, as a share of the prior, of a value that is kept after a departure."""
DOUBT = 0.2
"""Smallest standard deviation, as a share of the prior, of a value that an earlier push has estimated."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A measurement with closed contacts.

    Attributes:
        time: Time of the measurement, s.
        poses: Measured poses of the objects, NaN for unseen ones, (n, 3).
        places: Places X_i, (n, 3).
        noise: Nominal standard deviations, m and rad, (2,).
        found: Standard deviations estimated from measurements near this time, (2,); None while there are too few.
    """

    time: float
    poses: FloatArray
    places: FloatArray
    noise: FloatArray
    found: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Linear:
    """Errors of samples, linearised about the values.

    Attributes:
        samples: Linearised samples.
        sigma: Standard deviations that scale the errors, m, m and rad, (m, 3).
        seen: Whether each object was seen in each sample, (k, n).
        errors: Scaled errors of all seen objects, sample by sample, (m, 3).
        jacobian: Derivatives of the errors by the values, (m, 3, p).
        weights: Weights by Student's t, (m,).
        gradient: Gradient of half the sum of squares, with priors, (p,).
        hessian: Hessian of half the sum of squares, with priors, (p, p).
    """

    samples: list[Sample]
    sigma: FloatArray
    seen: BoolArray
    errors: FloatArray
    jacobian: FloatArray
    weights: FloatArray
    gradient: FloatArray
    hessian: FloatArray


class Estimator:
    """Estimates constant errors of the sensors and of the plate's motion.

    Args:
        settings: Settings with the priors.
        normals: Normals of the contacts through which the objects are pushed, in the frame of the places, (n, 2).
        wheels: Pose of the wheels' frame in the commanded frame, which is also the frame of the places, (3,).
        known: Estimator of an earlier push; its values of clock and wheels are the prior.
        aside_deviation: Standard deviation of the load's position along the plate after an approach, m. This error
            belongs to the pose of the plate, not to the camera.
        places: Places of the objects after an approach, (n, 3).
        headings: Standard deviations of the measured headings' constant errors, rad, (n,); None for the settings'.

    Attributes:
        settings: Settings with the priors.
        values: x, y (m), theta (rad) of C, tau (s), s_v, c, s_w, then x, y, theta of B_i for each object, (7 + 3 n,).
        covariance: Covariance of the values.
    """

    def __init__(
        self,
        settings: ControlSettings,
        normals: FloatArray,
        wheels: FloatArray,
        known: Estimator | None = None,
        *,
        aside_deviation: float = 0.0,
        places: FloatArray | None = None,
        headings: FloatArray | None = None,
    ) -> None:
        self.settings, self._normals, self._wheels = settings, normals, wheels
        self._count = count = len(normals)
        gauge = [settings.start_error[0]] * 2 + [settings.start_error[1]]
        scale = settings.odometry_error
        bias = [settings.bias[0]] * 2 + [settings.bias[1]]
        self._prior = np.array([*gauge, settings.delay_error, scale, scale, scale, *(bias * count)])
        if headings is not None:
            self._prior[COMMON + 2 :: 3] = headings
        self._center = np.zeros(len(self._prior))
        if known is not None:
            self._center[OWN] = known.values[OWN]
            self._prior[OWN] = np.maximum(np.sqrt(np.diag(known.covariance)[OWN]), DOUBT * self._prior[OWN])
        self._along = np.zeros(3 * count)  # change of the biases if the load stands 1 m farther to the left
        if aside_deviation > 0.0 and places is not None:
            self._along.reshape(-1, 3)[:, :2] = self._tangents(places)
        self._aside_shift = aside_deviation * np.array(
            [0.0, 1.0, *np.zeros(COMMON - 2), *-self._along]
        )  # of all values
        self.values: FloatArray = self._center.copy()
        self.covariance: FloatArray = self._prior_covariance
        self._found = np.zeros(2)
        self._precision: FloatArray = _inverse(self._prior_covariance)
        self._history, self._count_moved = np.zeros((1024, 4)), 0
        self._knots: list[FloatArray] = []
        self._samples: list[Sample] = []

    @property
    def _prior_covariance(self) -> FloatArray:
        """Prior covariance of the values, (p, p)."""
        return np.asarray(np.diag(self._prior**2) + np.outer(self._aside_shift, self._aside_shift))

    @property
    def count(self) -> int:
        """Number of stored samples."""
        return len(self._samples)

    @property
    def headings(self) -> tuple[FloatArray, FloatArray]:
        """Constant errors of the measured headings (n,) and their standard deviations (n,), rad."""
        return self.values[COMMON + 2 :: 3], np.sqrt(np.diag(self.covariance)[COMMON + 2 :: 3])

    @property
    def late(self) -> float:
        """Upper bound of the delay of measurements, s."""
        return max(0.0, float(self.values[DELAY] + 2.0 * math.sqrt(self.covariance[DELAY, DELAY])))

    def noise(self, samples: Sequence[Sample]) -> FloatArray:
        """Return the standard deviations (k, 2) of samples, m and rad: the larger of nominal and estimated ones."""
        stated = np.array([sample.noise for sample in samples])
        found = np.array([self._found if sample.found is None else sample.found for sample in samples])
        return np.asarray(np.maximum(np.maximum(stated, found), 1e-6))

    def unstamped(self) -> None:
        """Set the prior of the delay for measurements without time stamps."""
        late = self.settings.late
        self._center[DELAY], self._prior[DELAY] = late, late
        self.values[DELAY], self.covariance[DELAY, DELAY] = late, late**2
        self._precision = _inverse(self._prior_covariance)

    def moved(self, time: float, plate: FloatArray) -> None:
        """Record the pose of the plate (3,) by commands or odometry."""
        k = self._count_moved
        if k == len(self._history):
            self._history = np.concatenate([self._history, np.zeros_like(self._history)])
        self._history[k] = time, *plate
        self._count_moved = k + 1
        if k and k % KNOT == 0:
            self._knots.append(log(relative(self._history[k - KNOT, 1:], plate)))

    def add(self, sample: Sample) -> None:
        """Store a measurement with closed contacts."""
        self._samples.append(sample)
        if len(self._samples) > ROOM:
            half = ROOM // 2
            self._samples = self._samples[:half:2] + self._samples[half:]

    def forget(self, since: float, until: float) -> None:
        """Drop the samples between two times, because of an event or open contacts."""
        self._samples = [sample for sample in self._samples if not since <= sample.time <= until]

    def plate(self, time: float) -> FloatArray:
        """Return the estimated pose of the plate (3,) at a time."""
        return np.asarray(self._plates(self.values, *self._locate(np.array([time])))[0])

    def astray(self, driven: float, turned: float) -> float:
        """Return the standard deviation of the plate's position after a transit without measurements, m.

        Args:
            driven: Driven distance, m.
            turned: Sum of the absolute turns, rad.
        """
        heading, _, along, aside, turns = (math.sqrt(self.covariance[p, p]) for p in range(START_THETA, COMMON))
        return math.hypot(heading, along, aside, 0.5 * turns * turned) * driven

    def scaled(self, twist: FloatArray, wheels: FloatArray) -> FloatArray:
        """Return the actual body twist (3,) of a frame for a commanded one.

        Args:
            twist: Commanded twist, (3,).
            wheels: Pose of the wheels' frame in that frame, (3,).
        """
        return np.asarray(_scaled(twist[None], self.values, wheels)[0])

    def asked(self, twist: FloatArray, wheels: FloatArray) -> FloatArray:
        """Return the commanded body twist (3,) that gives an actual one; inverse of `scaled`."""
        s, c, w = self.values[WHEELS]
        x, y, turn = twist_of(wheels, twist)
        size = (1 + s) ** 2 + c**2
        command = [((1 + s) * x + c * y) / size, ((1 + s) * y - c * x) / size, turn / (1 + w)]
        return twist_of(inverse(wheels), command)

    def unbiased(self, poses: FloatArray, places: FloatArray) -> FloatArray:
        """Return measured poses (n, 3) without their bias along contact normals and in angle.

        The bias along a contact stays, because it cannot be told from a slide.

        Args:
            poses: Measured poses, (n, 3).
            places: Places X_i, (n, 3).
        """
        bias = self.values[COMMON:].reshape(-1, 3)
        return compose(poses, inverse(bias - self._aside(places)))

    def aside(self, places: FloatArray) -> tuple[float, float]:
        """Return the lateral offset of the load on the plate, left positive, and its standard deviation, m.

        Args:
            places: Places X_i, (n, 3).
        """
        gradient = np.zeros((self._count, 3))
        gradient[:, :2] = self._tangents(places) / self._count
        along = np.concatenate([np.zeros(COMMON), gradient.reshape(-1)])
        return float(along @ self.values), math.sqrt(along @ self.covariance @ along)

    def take_for_closed(self, resting: Sample, recent: Iterable[Sample]) -> None:
        """Restart from resting objects that have slid to new places with closed contacts.

        Errors along the contacts become slides; the remaining errors become biases of the camera. Earlier samples
        count only for the shared values, because the slides would look like errors of the plate.

        Args:
            resting: Mean of the measurements at rest, with the new places.
            recent: Measurements at rest; together with later ones they determine the delay.
        """
        self.values = self.values - np.append(np.zeros(COMMON), self._aside(resting.places))
        (rest,) = self.residuals([resting])
        self.values[COMMON:] += rest.reshape(-1)
        likely, doubted = self._prior_covariance, np.diag((DOUBT * self._prior[:COMMON]) ** 2)
        likely[:COMMON], likely[:, :COMMON] = 0.0, 0.0
        likely[:COMMON, :COMMON] = self.covariance[:COMMON, :COMMON] + doubted
        self._precision = _inverse(likely)
        self._center, self._samples = self.values, []
        for one in recent:
            self.add(replace(one, places=resting.places))
        self.fit(resting.time + HOLD)

    def _tangents(self, places: FloatArray) -> FloatArray:
        """Return the contact tangents (n, 2) in the frames of the objects at places (n, 3)."""
        along = np.arctan2(self._normals[:, 1], self._normals[:, 0]) + 0.5 * np.pi - places[:, 2]
        return np.stack([np.cos(along), np.sin(along)], axis=-1)

    def _aside(self, places: FloatArray) -> FloatArray:
        """Return the part of the biases (n, 3) along the contacts, in the objects' frames."""
        t = self._tangents(places)
        bias = self.values[COMMON:].reshape(-1, 3)
        tangential = (bias[:, :2] * t).sum(axis=1, keepdims=True) * t
        return np.concatenate([tangential, np.zeros((len(bias), 1))], axis=1)

    def residuals(self, samples: list[Sample]) -> FloatArray:
        """Return the errors of measurements (k, n, 3) from the expected poses, in the objects' frames."""
        times, poses, places = _arrays(samples)
        plates = self._plates(self.values, *self._locate(times - self.values[DELAY]))
        return self._errors(plates, poses, places)

    def spread(self, sample: Sample) -> FloatArray:
        """Return the standard deviations (n, 2) of the expected poses of a sample, m and rad."""
        jacobian = self._linear([sample])[1][0]
        own = np.einsum("nip,pq,niq->ni", jacobian, self.covariance, jacobian)
        position, angle = 0.5 * own[:, :2].sum(axis=1), own[:, 2]
        return np.asarray(np.sqrt(np.stack([position + MODEL[0] ** 2, angle + MODEL[1] ** 2], axis=-1)))

    def fit(self, now: float) -> None:
        """Fit the values to all samples that are older than `HOLD`."""
        self._update_noise(now - HOLD)
        samples = [sample for sample in self._samples if sample.time <= now - HOLD]
        if len(samples) < 8:
            return
        linear = self.linear(samples)  # one Gauss-Newton step on from the last fit
        self.covariance = _inverse(linear.hessian)
        self.values = self.values - self.covariance @ linear.gradient

    def doubt(self, now: float) -> None:
        """Reset the poorly known values of clock and wheels to their priors after an object has left its place.

        The slide could have begun before it was noticed; at the start of a push it looks like a rotation error of the
        wheels. The start and the biases are fitted again without these values.
        """
        sigma = np.sqrt(np.diag(self.covariance))
        unsure = np.zeros(len(sigma), dtype=np.bool_)
        unsure[OWN] = sigma[OWN] > KNOWN * self._prior[OWN]
        precision = self._precision
        self._precision = precision + np.diag(np.where(unsure, (PINNED / self._prior) ** 2, 0.0))
        self.values = np.where(unsure, self._center, self.values)
        self.fit(now)
        self._precision = precision
        self.covariance[unsure], self.covariance[:, unsure] = 0.0, 0.0
        self.covariance += np.diag(np.where(unsure, self._prior**2, 0.0))

    def linear(self, samples: list[Sample] | None = None) -> Linear:
        """Return samples, or all stored ones, linearised about the values."""
        samples = self._samples if samples is None else samples
        errors, jacobian = self._linear(samples)
        sigma = np.broadcast_to(self.noise(samples)[:, None, [0, 0, 1]], errors.shape)
        errors, jacobian = errors / sigma, jacobian / sigma[..., None]
        seen = ~np.isnan(errors[..., 0])
        weights = (FREEDOM + 3.0) / (FREEDOM + (errors[seen] ** 2).sum(axis=1))
        errors, jacobian = errors[seen], jacobian[seen]
        weighted = (weights[:, None, None] * jacobian).reshape(-1, len(self.values)).T
        hessian = weighted @ jacobian.reshape(-1, len(self.values)) + self._precision
        gradient = weighted @ errors.reshape(-1) + self._precision @ (self.values - self._center)
        return Linear(samples, sigma[seen], seen, errors, jacobian, weights, gradient, hessian)

    def ways(self, samples: list[Sample]) -> FloatArray:
        """Return the driven distance of the plate (k,) at the times of samples, m."""
        history = self._history[: self._count_moved]
        ways = np.append(0.0, np.cumsum(np.hypot(*np.diff(history[:, 1:3], axis=0).T)))
        times = np.array([sample.time for sample in samples]) - self.values[DELAY]
        return np.asarray(np.interp(times, history[:, 0], ways))

    def estimates(self, names: Sequence[str]) -> dict[str, tuple[float, float]]:
        """Return the values and their standard deviations by name, in SI units.

        The names are `start x`, `start y`, `start theta` of the plate, `delay` of measurements, `odometry` (relative
        error of the driven distance), lateral `drift`, `turns`, and `NAME x`, `NAME y`, `NAME theta` for the
        measurement bias of each named object in its own frame.
        """
        own = [f"{name} {axis}" for name in names for axis in ("x", "y", "theta")]
        sigma = np.sqrt(np.diag(self.covariance))
        return {key: (float(v), float(s)) for key, v, s in zip([*NAMES, *own], self.values, sigma, strict=False)}

    def words(self) -> str:
        """Return the found errors as text; see `errors_in_words`."""
        values, along = self.values.copy(), self._along
        if along.any():  # a lateral offset of the load on the plate is not an error of the camera
            values[COMMON:] -= along * (values[COMMON:] @ along) / (along @ along)
        return errors_in_words(values, np.sqrt(np.diag(self.covariance)), self._prior)

    def _update_noise(self, until: float) -> None:
        """Estimate the noise of the last samples up to a time.

        Earlier samples keep their estimate, because a camera that gets worse has measured well before.
        """
        recent = [sample for sample in self._samples if sample.time <= until][-4 * NOISY :]
        if len(recent) < 2:
            return
        found = noise_between(np.array([sample.time for sample in recent]), self.residuals(recent))
        if found is not None:
            since, self._found = recent[-2 * NOISY :][0].time, found
            self._samples = [replace(s, found=found) if s.time >= since else s for s in self._samples]

    def _errors(self, plates: FloatArray, poses: FloatArray, places: FloatArray) -> FloatArray:
        expected = compose(plates[:, None], compose(places, self.values[COMMON:].reshape(-1, 3)))
        errors = relative(expected, poses)
        errors[..., 2] = wrap_angle(errors[..., 2])
        return errors

    def _linear(self, samples: list[Sample]) -> tuple[FloatArray, FloatArray]:
        """Return errors (k, n, 3) and their derivatives (k, n, 3, p); those by the small B_i are taken as -1."""
        times, poses, places = _arrays(samples)
        moments = self._locate(times - self.values[DELAY])
        plates = self._plates(self.values, *moments)
        moved = np.zeros((len(samples), 3, COMMON))  # derivative of the plate's pose by each value
        away = plates[:, :2] - compose(self._history[0, 1:], self.values[:3])[:2]
        for p in (0, 1):
            ahead = rotate(float(self._history[0, 3]), np.eye(3)[p, :2])
            moved[:, :2, p] = rotate(-plates[:, 2], np.broadcast_to(ahead, away.shape))
        moved[:, :2, START_THETA] = rotate(-plates[:, 2], np.stack([-away[:, 1], away[:, 0]], axis=-1))
        moved[:, 2, START_THETA] = 1.0
        for p in range(DELAY, COMMON):
            values = self.values.copy()
            values[p] += STEPS[p]
            at = self._locate(times - values[DELAY]) if p == DELAY else moments
            moved[:, :, p] = log(relative(plates, self._plates(values, *at))) / STEPS[p]
        there = compose(places, self.values[COMMON:].reshape(-1, 3))
        jacobian = np.zeros((*there.shape, len(self.values)))
        arm = np.stack([-there[..., 1], there[..., 0]], axis=-1)[..., None] * moved[:, None, 2:, :]
        motion = moved[:, None, :2, :] + arm
        cos, sin = np.cos(there[..., 2])[..., None], np.sin(there[..., 2])[..., None]
        jacobian[:, :, 0, :COMMON] = -(cos * motion[:, :, 0] + sin * motion[:, :, 1])
        jacobian[:, :, 1, :COMMON] = sin * motion[:, :, 0] - cos * motion[:, :, 1]
        jacobian[:, :, 2, :COMMON] = -moved[:, None, 2, :]
        for i in range(self._count):
            jacobian[:, i, :, COMMON + 3 * i : COMMON + 3 * i + 3] = -np.eye(3)
        return self._errors(plates, poses, places), jacobian

    def _locate(self, times: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the index (k,) of the knot before each time, and the commanded motion (k, 3) since it."""
        times_moved, history = self._history[: self._count_moved, 0], self._history[: self._count_moved, 1:]
        last = len(history) - 1
        at = np.clip(times, times_moved[0], times_moved[-1])
        k = np.clip(np.searchsorted(times_moved, at, side="right") - 1, 0, max(last - 1, 0))
        after = np.minimum(k + 1, last)
        span = times_moved[after] - times_moved[k]
        share = (at - times_moved[k]) / np.where(span > 0.0, span, 1.0)
        poses = between(history[k], history[after], share[:, None])
        knot = k // KNOT
        return knot, log(relative(history[knot * KNOT], poses))

    def _plates(self, values: FloatArray, knot: IntArray, rest: FloatArray) -> FloatArray:
        """Return the poses of the plate (k, 3) after motions `rest` (k, 3) from knots."""
        begin = compose(self._history[0, 1:], values[:3])
        chain = chained(begin, exp(_scaled(np.array(self._knots).reshape(-1, 3), values, self._wheels)))
        return compose(chain[knot], exp(_scaled(rest, values, self._wheels)))


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _arrays(samples: list[Sample]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times (k,), poses (k, n, 3) and places (k, n, 3) of samples."""
    times = np.array([sample.time for sample in samples])
    return times, np.array([s.poses for s in samples]), np.array([s.places for s in samples])


def _scaled(twists: FloatArray, values: FloatArray, wheels: FloatArray) -> FloatArray:
    """Return the actual twists (k, 3) of a frame for commanded ones; see `Estimator.scaled`."""
    s, c, w = values[WHEELS]
    x, y, turn = twist_of(wheels, twists).T
    scaled = np.empty(twists.shape)
    scaled[:, 0], scaled[:, 1], scaled[:, 2] = (1 + s) * x - c * y, (1 + s) * y + c * x, (1 + w) * turn
    return twist_of(inverse(wheels), scaled)
