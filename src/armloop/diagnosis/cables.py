"""Elastic cables: where one runs between a fixed point and a link, by separable nonlinear least squares from many starts.

What pulls at a link from a point that rests is a law of the posture of all joints before it. Where it is slack at times a
search for events finds it in one push after the other, and one for laws in stops and springs of several joints; so it is
looked for where there are several of these, or more is left than the model's own shortcomings, and taken if the run is
likelier with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from armloop.diagnosis.account import Account
from armloop.diagnosis.beside import account_beside, at_the_cost_of_others, known_by, merged, with_account
from armloop.diagnosis.contacts import without
from armloop.diagnosis.evidence import FOLDS, Evidence
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.judgement import much_is_left
from armloop.diagnosis.onset import posterior
from armloop.diagnosis.outcomes import Found, Outcome
from armloop.diagnosis.posterior import TELLING
from armloop.diagnosis.search import ROUNDS
from armloop.diagnosis.trials import Known
from armloop.laws.effects.elastic_cable import Cable, ElasticCable
from armloop.model import AddedEffect
from armloop.regression.clustered import clustered_covariance
from armloop.robot.kinematics import LinkPoses
from armloop.util.arrays import TINY, Array, Index, Mask
from armloop.util.progress import Progress

#: Samples that a cable is fitted to, at most; places that are tried of each link, and of these the best that are refined.
_ROWS, _TRIED, _REFINED = 600, 200, 2
#: Parts of an arm's reach that an anchor, a point on a link and a slack length usually are: their normal priors.
_USUAL = np.array([1.0, 1.0, 1.0, 0.3, 0.3, 0.3, 1.0])
#: Part of what is usual by which a number that is held may move; a deviance, of two standard errors, no longer likely.
_HELD, _UNLIKELY = 1e-9, 4.0
#: Stiffness, slack length, anchor and point, of stiffness and the numbers of a cable.
_ORDER = [0, 7, *range(1, 7)]
#: The least part of what is usual by which a profile begins to move: what has no error by itself may yet bend.
_FIRST = 1e-3
#: Part of the reach below which a cable has no direction.
_POINT = 1e-6
#: Steps of a refinement, at most.
_STEPS = 40
#: A spring that leaves no more than this part less than a cable does not push in the run.
_SAME = 1e-3
#: By itself a cable explains at least this part of what the model leaves, or is not asked about.
_LEAST = 0.3


def account_with_cable(
    whole: Evidence, account: Account, progress: Progress, jobs: int | None
) -> Account | None:
    """The account of a run in which a cable pulls at a link; None where that is not likelier.

    Args:
        account: that without one.
    """
    if not _is_asked(account):
        return None
    progress("whether a cable pulls at a link")
    plain = without(whole, [])
    cable = find_cable(plain)
    if cable is None:
        return None
    rows = plain.rows & account.whole.rows
    least = posterior(account, account.remaining(), rows)
    # what was found may be there beside it, or be, if it is several things, what stood in its place
    several = len(account.outcome.found) + len(account.contacts) > 1
    accounts = [account, _of_nothing(account)] if several else [account]
    tried = [(each, with_account(plain, [cable], each)) for each in accounts]
    likelier = (
        known for each, known in tried if _is_likelier(_alone(each, plain, cable, known), rows, least)
    )
    known = next(likelier, None)
    if known is None:
        return None
    nowhere = np.zeros_like(whole.rows)
    other = account_beside(whole, known, nowhere, progress, jobs)
    for _ in range(ROUNDS):
        if not other.outcome.after.effects:
            break
        others = _beside(whole, cable, other)
        evidence = without(known_by(whole, others[0]), other.contacts)
        again = find_cable(evidence, [whole.left_by(whole.model.with_effects(each)) for each in others])
        if again is None:
            break
        before, cable = {effect.place for effect in other.outcome.after.effects}, again
        known = with_account(whole.only(other.evidence.rows), [cable], other)
        other = account_beside(whole, known, nowhere, progress, jobs)
        if before == {effect.place for effect in other.outcome.after.effects}:
            break
    more = merged(whole, [cable], other)
    if not any(isinstance(effect, ElasticCable) for effect in more.outcome.after.effects):
        return None
    if at_the_cost_of_others(account, more):
        return None
    return more if _is_likelier(more, rows & more.whole.rows, least) else None


def _is_asked(account: Account) -> bool:
    """Whether several events, or laws that load a joint, were found, a law that is not listed, or much is left."""
    laws = sum(found.effect.load for found in account.outcome.found)
    much = much_is_left(account.outcome.after.score).any()
    return account.unlisted is not None or bool(much) or len(account.contacts) + laws > 1


def _of_nothing(account: Account) -> Account:
    """The account without the effects found."""
    return replace(account, outcome=Outcome([], account.outcome.before, account.outcome.before))


def _alone(account: Account, evidence: Evidence, cable: Found, known: Known) -> Account:
    """The account of a run by the effects found and a cable, without events and laws that are not listed."""
    outcome = Outcome([cable, *account.outcome.found], account.outcome.before, known.fit)
    return replace(account, contacts=[], evidence=evidence, outcome=outcome, unlisted=None, further=())


def _beside(whole: Evidence, cable: Found, other: Account) -> list[list[AddedEffect]]:
    """The effects of an account as they are beside a cable: by all of the run, and by what is outside of each fold."""
    after, rows = other.outcome.after, other.evidence.rows
    effects, shapes = [cable.effect, *after.effects], [cable.shape, *after.shapes]
    found = [Known.of(whole.only(rows), effects, shapes)]
    for k in range(FOLDS):
        outside = whole.only(rows & (whole.fold != k)[:, None])
        found.append(Known.of(outside, effects, [Shape.fixed(shape.without[k]) for shape in shapes]))
    return [known.fit.added()[1:] for known in found]


def _is_likelier(account: Account, rows: Mask, least: float) -> bool:
    return posterior(account, account.remaining(), rows) > least


def find_cable(evidence: Evidence, left: Sequence[Array] = ()) -> Found | None:
    """The cable that explains most of a residual; of each fold where it runs on the samples outside of it.

    None where none explains much.

    Args:
        left: (N, n) the residual, and of each fold that of effects fitted outside of it, N·m (N); the model's by default.
    """
    whole_left, *lefts = left or [evidence.residual([])] * (FOLDS + 1)
    problem = _Problem.of(evidence, evidence.kept, whole_left)
    best, share = problem.best()
    if share < _LEAST:
        return None
    folds = evidence.fold[evidence.kept]
    outside = [_Problem.of(evidence, evidence.kept[folds != k], x).best()[0] for k, x in enumerate(lefts)]
    all_rows = _Problem.of(evidence, evidence.kept, whole_left, len(evidence.kept))
    errors = problem.over_links(best, problem.profiled(best, *all_rows.errors(best)))
    cables = [replace(best, errors=tuple(errors.tolist())), *outside]
    shape = Shape(cables[0].key, tuple(cable.key for cable in outside))
    return Found(ElasticCable(cables=cables), shape, 0.0)


@dataclass(frozen=True, eq=False)
class _Problem:
    """Samples (K, n) and the residual that a cable has to explain, weighted."""

    poses: LinkPoses
    weight: Array
    y: Array
    block: Index
    reach: float

    @staticmethod
    def of(evidence: Evidence, rows: Index, left: Array, most: int = _ROWS) -> _Problem:
        """Of what is left (N, n) at samples ``rows``, no more than so many of them."""
        rows = rows[:: -(-len(rows) // most)]
        weight = evidence.rows[rows] / evidence.scale
        poses = LinkPoses.of(evidence.model.arm, evidence.samples.motion.q[rows])
        reach = float(max(np.linalg.norm(p - poses.origins[0], axis=1).max() for p in poses.p))
        y = left[rows] * weight
        return _Problem(poses, weight, y, evidence.blocks[rows], max(reach, 0.1))

    @cached_property
    def found(self) -> list[tuple[float, Cable]]:
        """Per link the best cable to it, after the squares that it leaves."""
        return [self._of_link(link) for link in range(len(self.poses.p))]

    def best(self) -> tuple[Cable, float]:
        """The cable that leaves least, and the part of the squares that it explains."""
        left, cable = min(self.found, key=lambda one: one[0])
        return cable, 1 - left / max(float((self.y**2).sum()), TINY)

    def over_links(self, cable: Cable, errors: Array) -> Array:
        """Standard errors (9,), the link's last, that hold the best cables to all links, by their likelihoods.

        No more blocks count than tell.
        """
        blocks = min(len(np.unique(self.block)), TELLING)
        lefts = np.array([left for left, _ in self.found])
        deviance = blocks * np.log(lefts / lefts.min())
        odds = np.where(deviance > _UNLIKELY, 0.0, np.exp(-deviance / 2))
        each = np.array([[*self._stated(other), other.link] for _, other in self.found])
        off = np.sqrt(odds @ (each - [*self._stated(cable), cable.link]) ** 2 / odds.sum())
        off[5:8] = 0.0  # of a point in the frame of another link
        return np.hypot([*errors, 0.0], off)

    def _stated(self, cable: Cable) -> Array:
        """(8,) stiffness, slack length, anchor and point."""
        x = _numbers(cable)
        return np.r_[self._stiffness(self._torque(cable.link - 1, x, cable.pushes)), x][_ORDER]

    def errors(self, cable: Cable) -> tuple[Array, float]:
        """Standard errors (8,) of stiffness, slack length, anchor and point; their priors are one more observation.

        Returns:
            The errors, and the number of independent torques: by so much more do errors of a block vary together (design
            effect; Kish, Survey Sampling, 1965).
        """
        link, x = cable.link - 1, _numbers(cable)
        torque = self._torque(link, x, cable.pushes)
        k = self._stiffness(torque)
        counts = self.weight > 0
        slopes = k * self._torque_slopes(link, x, cable.pushes)
        X = np.concatenate([torque[:, :, None], slopes], axis=2)[counts]
        left = (self.y - k * torque)[counts]
        block = np.broadcast_to(self.block[:, None], counts.shape)[counts]
        prior = np.hstack([np.zeros((7, 1)), np.diag(1 / (_USUAL * self.reach))])
        X, left = np.vstack([X, prior]), np.r_[left, -prior[:, 1:] @ x]
        spread = clustered_covariance(X, left, np.r_[block, block.max() + 1 + np.arange(7)])
        alone = np.diag(np.linalg.pinv(X.T @ X)) * float(left @ left) / len(left)
        effect = float(np.median(np.diag(spread) / np.maximum(alone, TINY)))
        errors = np.sqrt(np.maximum(np.diag(spread), 0.0))[_ORDER]
        return errors, len(left) / max(effect, 1.0)

    def profiled(self, cable: Cable, errors: Array, count: float) -> Array:
        """Standard errors (8,) by profile likelihood along each coordinate of anchor and point, where these are larger.

        Coordinates that a run hardly shows bend the others, far beyond what holds at the best: a slack length hangs on what
        lies across the cable by a square, and an arm of few joints is met by a whole family of cables.

        Args:
            errors: (8,) of the best, and ``count`` of independent torques.
        """
        link, x, found = cable.link - 1, _numbers(cable), errors.copy()
        best = self._squares(link, x, cable.pushes)
        at = self._stated(cable)
        usual = _USUAL * self.reach
        for i, way in product(range(6), (1.0, -1.0)):
            step, y = way * max(errors[2 + i], _FIRST * usual[i]), x
            while abs(y[i] - x[i]) < usual[i]:
                left, y = self._refined(link, y + step * np.eye(7)[i], cable.pushes, i)
                deviance = count * (left / best - 1)
                if deviance > _UNLIKELY:
                    break
                k = self._stiffness(self._torque(link, y, cable.pushes))
                off = np.abs(np.r_[k, y][_ORDER] - at)
                found = np.maximum(found, off / max(np.sqrt(max(deviance, 0.0)), 1.0))
                step *= 2
        return found

    def _of_link(self, link: int) -> tuple[float, Cable]:
        """The best cable to a link (from 0), and the squares that it leaves."""
        starts = sorted(((self._squares(link, x), x) for x in self._starts(link)), key=lambda one: one[0])
        refined = [self._refined(link, x) for _, x in starts[:_REFINED]]
        left, x = min(refined, key=lambda one: one[0])
        spring = self._refined(link, x, True)
        pushes = spring[0] < (1 - _SAME) * left
        left, x = spring if pushes else (left, x)
        a, b, c, d, e, f, slack = x.tolist()
        return left, Cable(link + 1, (a, b, c), (d, e, f), max(slack, 0.0), pushes)

    def _starts(self, link: int) -> Sequence[Array]:
        """Anchors around the link, points on it, and slack lengths between those that it has in the run, or none."""
        rng, middle, starts = np.random.default_rng(link), self.poses.p[link].mean(axis=0), []
        for _ in range(_TRIED):
            anchor = middle + self.reach * rng.uniform(-1.3, 1.3, 3)
            point = 0.5 * _USUAL[3] * self.reach * rng.normal(size=3)
            length = np.linalg.norm(self.poses.p[link] + self.poses.R[link] @ point - anchor, axis=1)
            slack = float(np.quantile(length, rng.uniform(0.0, 0.8))) * (rng.random() < 0.8)
            starts.append(np.array([*anchor, *point, slack]))
        return starts

    def _refined(
        self, link: int, x: Array, pushes: bool = False, held: int | None = None
    ) -> tuple[float, Array]:
        """Squares left, and where the cable runs that a start leads to, in parts of what is usual.

        Args:
            held: which of its numbers stays as it is.
        """
        usual = _USUAL * self.reach

        def left(parts: Array) -> Array:
            return np.concatenate([self._left(link, usual * parts, pushes).ravel(), parts])

        def slopes(parts: Array) -> Array:
            return np.vstack([self._slopes(link, usual * parts, pushes).reshape(-1, 7) * usual, np.eye(7)])

        lower, upper = np.array([*np.full(6, -np.inf), 0.0]), np.full(7, np.inf)
        if held is not None:
            lower[held], upper[held] = x[held] / usual[held] + np.array([-_HELD, _HELD])
        found = least_squares(left, x / usual, slopes, (lower, upper), max_nfev=_STEPS)
        return self._squares(link, usual * found.x, pushes), usual * found.x

    def _squares(self, link: int, x: Array, pushes: bool = False) -> float:
        return float((self._left(link, x, pushes) ** 2).sum())

    def _left(self, link: int, x: Array, pushes: bool) -> Array:
        """(K, n) what a cable leaves, of the stiffness that leaves least (variable projection)."""
        torque = self._torque(link, x, pushes)
        return np.asarray(self.y - self._stiffness(torque) * torque)

    def _stiffness(self, torque: Array) -> float:
        return max(float((torque * self.y).sum()) / max(float((torque**2).sum()), TINY), 0.0)

    def _slopes(self, link: int, x: Array, pushes: bool) -> Array:
        """(K, n, 7) derivative of what a cable leaves, with that of the stiffness that leaves least."""
        torque, slopes = self._torque(link, x, pushes), self._torque_slopes(link, x, pushes)
        k, squares = self._stiffness(torque), max(float((torque**2).sum()), TINY)
        stiffer = np.einsum("kn,knm->m", self.y - 2 * k * torque, slopes) / squares if k > 0 else np.zeros(7)
        return np.asarray(-k * slopes - torque[:, :, None] * stiffer)

    def _torque(self, link: int, x: Array, pushes: bool) -> Array:
        """(K, n) of a cable of unit stiffness, weighted."""
        d, _, part = self._drawn(link, x, pushes)
        return self.poses.torques(link, x[:3] + d, part[:, None] * d) * self.weight

    def _torque_slopes(self, link: int, x: Array, pushes: bool) -> Array:
        """(K, n, 7) derivative of the same with respect to anchor, point and slack length."""
        d, length, part = self._drawn(link, x, pushes)
        R, p, force = self.poses.R[link], x[:3] + d, part[:, None] * d
        taut = (part > 0) | pushes
        moves = np.concatenate([np.broadcast_to(-np.eye(3), R.shape), R], axis=2)
        longer = np.einsum("kf,kfm->km", d, moves) * np.where(taut, x[6] / length**3, 0.0)[:, None]
        forces = np.concatenate(
            [
                part[:, None, None] * moves + d[:, :, None] * longer[:, None, :],
                d[:, :, None] * np.where(taut, -1 / length, 0.0)[:, None, None],
            ],
            axis=2,
        )
        slopes = np.einsum("kfn,kfm->knm", self.poses.jacobian(link, p), forces)
        # where the point moves, the same force has other lever arms, in proportion
        torque = self.poses.torques(link, p, force)
        for m in range(3):
            slopes[:, :, 3 + m] += self.poses.torques(link, p + R[:, :, m], force) - torque
        return np.asarray(slopes * self.weight[:, :, None])

    def _drawn(self, link: int, x: Array, pushes: bool) -> tuple[Array, Array, Array]:
        """From the anchor to the point (K, 3), how long that is (K,), and the force of unit stiffness as a part of it."""
        d = self.poses.p[link] + self.poses.R[link] @ x[3:6] - x[:3]
        length = np.maximum(np.linalg.norm(d, axis=1), _POINT * self.reach)
        stretch = length - x[6] if pushes else np.maximum(length - x[6], 0.0)
        return d, length, stretch / length


def _numbers(cable: Cable) -> Array:
    """(7,) anchor, point and slack length."""
    return np.array([*cable.anchor, *cable.attached, cable.slack_length])
