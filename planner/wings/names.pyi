# Names that shipped extensions give to ``planner``, for type checkers and editors; see ``register_names``.

from planner.reproduction.papers_result import PapersResult as PapersResult
from planner.reproduction.papers_result import papers as papers
from planner.studies.cell_study import StudyResult as StudyResult
from planner.studies.cell_study import study as study
from planner.studies.observability import Observability as Observability
from planner.studies.observability import SelectedPoses as SelectedPoses
from planner.studies.observability import observability as observability
from planner.studies.observability import select as select
from planner.studies.sweep import SweepResult as SweepResult
from planner.studies.sweep import sweep as sweep
from planner.workflow.checking import CheckPlanResult as CheckPlanResult
from planner.workflow.checking import CheckResult as CheckResult
from planner.workflow.checking import check as check
from planner.workflow.checking import plan_check as plan_check
from planner.workflow.loaded_planning import CircularPlanResult as CircularPlanResult
from planner.workflow.recording import record as record
