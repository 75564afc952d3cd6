"""The longest files are handed out first, so that no worker is left alone with one of them at the end."""

LONGEST = (
    "workflow/test_plan", "workflow/test_places", "test_examples", "identification/test_real", "motion/path/test_join",
    "workflow/test_identify", "instruments/accuracy/test_command", "gauges/trical/test_plan", "tracing/test_screen",
    "instruments/circular/test_loads", "report/test_page", "report/test_calibration_page", "studies/test_places",
)  # fmt: skip


def pytest_collection_modifyitems(items):
    place = {f"tests/{name}.py": k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.nodeid.split("::")[0], len(place)))
