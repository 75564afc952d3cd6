// Times in the zone of whoever looks; the title keeps them in UTC.
import { timeText } from "./common.js";

for (const node of document.querySelectorAll("time[datetime]")) {
  node.title = node.textContent;
  node.textContent = timeText(node.dateTime);
}
for (const option of document.querySelectorAll("option[data-at]")) {
  option.textContent = option.textContent.replace(/\d{4}-\d\d-\d\d \d\d:\d\d UTC/, timeText(option.dataset.at));
}
