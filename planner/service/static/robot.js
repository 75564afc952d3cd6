import { find, get } from "./common.js";
import { lineChart } from "./linechart.js";

const DAY = 86400000;
const record = await get(`/api/records/${encodeURIComponent(document.body.dataset.serial)}`);
if (record.check_days.length) {
  const days = record.check_days.map((day) => Date.parse(day) / DAY);
  const draw = (title, series) => lineChart(title, "day of the check", days, series, (t) => new Date(t * DAY).toISOString().slice(0, 10));
  find("#drift").append(
    draw("Zero of each axis since the calibration, as motion of the tool in mm if it alone had moved; bars: two standard deviations.", record.drift_mm),
    draw("How much rarer than an alarm allows chance gives such readings, in powers of ten: above 0 something has changed.", [
      { name: "check", values: record.beyond_chance }, { name: "alarm", values: record.beyond_chance.map(() => 0), limit: true }]));
}
