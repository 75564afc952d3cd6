"""Robot, tool, fixtures, gauge and surroundings, read from one TOML file, and the measurement set-up made of them."""

__all__ = [
    "cell", "declared", "file", "fleet_file", "gauge", "gauge_registry", "gauge_types", "parts", "placement",
    "places", "reading", "region_file", "section_content", "section_registry", "site", "workspace",
]  # fmt: skip
