import { find, get } from "/static/common.js";
import { lineChart } from "/static/linechart.js";

const record = await get(`/api/records/${encodeURIComponent(document.body.dataset.serial)}`);
if (record.check_days.length) {
  const draw = (title, series) => lineChart(title, "days since the first entry", record.check_days, series);
  find("#drift").append(
    draw("Zero of each axis as motion of the tool, mm", record.drift_mm),
    draw("Decades beyond chance: above 0 something has changed", [
      { name: "by the checks", values: record.beyond_chance }, { name: "alarm", values: record.beyond_chance.map(() => 0) }]));
}
