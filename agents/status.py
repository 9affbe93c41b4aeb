"""What a controller says of its robot for people, a few times a second.

Read off the row that is recorded anyway: between two of these words nothing is computed for them.
"""

from agents.agent import Agent
from bridge.network.messages import Progress
from bridge.network.status import ControllerStatus, Heard, Value, known
from configs.signals import PATH_ERRORS, SENT_SIGNALS

_NAMES = (*(signal.name for signal in PATH_ERRORS), *(signal.name for signal in SENT_SIGNALS[:2]))


class Narrator:
    """Says how far an agent is and how its robot does."""

    def __init__(self, agent: Agent) -> None:
        self._agent = agent
        self._period_ns = agent.brief.schedule.period_ns
        names = [signal.name for signal in agent.brief.signals]
        self._columns = [names.index(name) for name in _NAMES]

    def status(self, tick: int) -> ControllerStatus:
        """The state of the robot at this tick."""
        agent, row = self._agent, self._agent.row
        values: list[Value] = [known(row[at]) for at in self._columns] if row else [None] * 5
        x_e_m, y_e_m, theta_e_rad, right, left = values
        ages_s = agent.neighbours(max(tick, 0) * self._period_ns)
        heard = tuple(Heard(name, known(age_s)) for name, age_s in ages_s)
        phase = agent.phase.name.lower()
        return ControllerStatus(phase, x_e_m, y_e_m, theta_e_rad, right, left, heard)

    def progress(self, tick: int) -> Progress:
        """The message of this tick."""
        return Progress(tick, tick * self._period_ns, 0, self.status(tick))
