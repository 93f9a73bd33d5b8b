"""Springs, which no rigid body is, as what else may explain a record: at every joint, and between any two."""

from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.identification.reconstruction.plain_fits import PlainFits


def test_a_spring_between_two_joints_is_one_of_them() -> None:
    motion = fourier_motion(30.0, 100.0, 3)
    tension = 3.0 * (motion.q[:, 1] - 0.7 * motion.q[:, 2])
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    tau += tension[:, None] * [0.0, 1.0, -0.7]
    problem = PlainFits.of([measured(motion, tau, 3)], three_axis(), 10.0)
    assert problem is not None
    plain, sprung = problem.left(), problem.sprung().left()
    assert plain.over(sprung, [1, 2]) > 5.0 and (sprung.relative < 0.05).all()
