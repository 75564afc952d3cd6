// Moves the bodies of the view: each vertex is carried by one frame, whose pose is known at every step of the slider.
(function () {
  const view = document.getElementById("view"), data = JSON.parse(document.getElementById("player-data").textContent);
  const slider = document.getElementById("slider"), text = document.getElementById("state"), button = document.getElementById("play");
  const floats = s => new Float32Array(Uint8Array.from(atob(s), c => c.charCodeAt(0)).buffer);
  const poses = floats(data.poses), stride = 12 * data.carriers;
  const groups = data.groups.map(g => ({vertices: floats(g.vertices), carrier: floats(g.carrier)}));
  let playing = false, busy = false, wanted = 0;

  function carried(group, step) {
    const n = group.carrier.length, out = [new Float32Array(n), new Float32Array(n), new Float32Array(n)];
    for (let v = 0; v < n; v++) {
      const p = step * stride + 12 * group.carrier[v];
      const x = group.vertices[3 * v], y = group.vertices[3 * v + 1], z = group.vertices[3 * v + 2];
      for (let k = 0; k < 3; k++)
        out[k][v] = poses[p + 4 * k] * x + poses[p + 4 * k + 1] * y + poses[p + 4 * k + 2] * z + poses[p + 4 * k + 3];
    }
    return out;
  }
  function show(step) {
    wanted = step;
    slider.value = step;
    text.textContent = data.labels[step];
    if (busy) return;
    busy = true;
    const moved = groups.map(g => carried(g, step));
    Plotly.restyle(view, {x: moved.map(m => m[0]), y: moved.map(m => m[1]), z: moved.map(m => m[2])}, groups.map((_, k) => k))
      .then(() => { busy = false; if (wanted !== step) show(wanted); });
  }
  function play() {
    if (!playing) return;
    show((Number(slider.value) + 1) % data.labels.length);
    setTimeout(() => requestAnimationFrame(play), 60);
  }
  slider.max = data.labels.length - 1;
  slider.oninput = () => show(Number(slider.value));
  button.onclick = () => { playing = !playing; button.textContent = playing ? "Pause" : "Play"; play(); };
  for (const id of ["all", "near"])
    document.getElementById(id).onclick = () => {
      const [x, y, z] = data.ranges[id];
      Plotly.relayout(view, {"scene.xaxis.range": x, "scene.yaxis.range": y, "scene.zaxis.range": z});
    };
  show(0);
})();
