// The page in a frame of a notebook. Step and build go both ways, as messages between frame and model.
function render({ model, el }) {
  const frame = document.createElement("iframe"), state = () => ({ step: model.get("step"), build: model.get("build") });
  Object.assign(frame, { srcdoc: model.get("page"), title: "step viewer" });
  Object.assign(frame.style, { width: "100%", height: `${model.get("height")}px`, border: "0", background: "#fff" });
  let heard = null, hearing = false;  // what the frame shows is not sent back
  const send = () => {
    const now = state();
    if (heard && !hearing && (now.step !== heard.step || now.build !== heard.build)) frame.contentWindow.postMessage({ seqopt: now }, "*");
  };
  const hear = ({ source, data }) => {
    if (source !== frame.contentWindow || !data?.seqopt) return;
    const first = heard === null, asked = state();
    heard = data.seqopt;
    if (first && (asked.step || asked.build)) return send();
    hearing = true;
    model.set("step", heard.step);
    model.set("build", heard.build);
    hearing = false;
    model.save_changes();
  };
  window.addEventListener("message", hear);
  model.on("change:step change:build", send);
  el.append(frame);
  return () => { window.removeEventListener("message", hear); model.off("change:step change:build", send); };
}
export default { render };
