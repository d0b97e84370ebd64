"""What the robot knows of itself: state estimates and their errors."""

from __future__ import annotations

from blocks.core import Block, BlockState, Input, Output, Pose, PoseValue, State, kernel_of, param


class PoseNoise(Block):
    """Add white Gaussian noise to a pose, anew on each tick (paper, case B).

        pose ─▶ [ PoseNoise ] ─▶ measured

    measured = pose + N(0, diag(sigma_position^2, sigma_position^2, sigma_heading^2)).
    """

    pose = Input(Pose, doc="the true pose")
    measured = Output(Pose, through="pose", doc="the estimate that controllers see")

    sigma_position: float = param(0.05, unit="m", at_least=0.0, doc="deviation of x and of y")
    sigma_heading: float = param(0.1, unit="rad", at_least=0.0, doc="deviation of theta")

    noise = State(3, doc="the noise of the coming tick: m, m, rad")

    def start(self, state: BlockState) -> None:
        self._draw(state)

    def _draw(self, state: BlockState) -> None:
        state.rng.standard_normal(out=state.noise)
        state.noise[:2] *= self.sigma_position
        state.noise[2] *= self.sigma_heading

    @kernel_of(_draw)
    def _draw_kernel(self, state: BlockState) -> None:
        for i in range(3):
            state.noise[i] = state.rng.standard_normal()
        state.noise[0] *= self.sigma_position
        state.noise[1] *= self.sigma_position
        state.noise[2] *= self.sigma_heading

    def output(self, state: BlockState, t: float, pose: PoseValue) -> PoseValue:
        nx, ny, ntheta = state.noise.tolist()
        return pose[0] + nx, pose[1] + ny, pose[2] + ntheta

    def update(self, state: BlockState, t: float) -> None:
        self._draw(state)
