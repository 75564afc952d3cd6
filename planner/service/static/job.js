import { watchJob } from "/static/progress.js";

watchJob();
