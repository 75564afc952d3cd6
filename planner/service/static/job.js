import { watchJob } from "/static/progress.js";
import { offerRecord } from "/static/record.js";

watchJob();
offerRecord(document.body.dataset.job);
