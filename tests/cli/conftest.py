"""The small plans of the workflow's tests are the commands' inputs here too."""

from tests.workflow.conftest import moving

__all__ = ["moving"]
