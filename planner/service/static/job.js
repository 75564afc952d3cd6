import { watchJob } from "./progress.js";
import { offerRecord } from "./record.js";

watchJob();
offerRecord(document.body.dataset.job);
