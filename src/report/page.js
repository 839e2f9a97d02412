// The comparison slider of each view. Without this script the page shows the pictures side by side.
for (const pictures of document.querySelectorAll(".pictures")) {
  const stage = document.createElement("div");
  const slider = document.createElement("input");
  const add = (element, name, text) => {
    element.className = name;
    element.textContent = text;
    stage.append(element);
  };
  const copy = (name) => pictures.querySelector(`.${name} img`).cloneNode();
  const before = copy("before");
  const after = copy("after");
  stage.className = "stage";
  after.className = "over";
  stage.append(before, after);
  add(document.createElement("span"), "tag left", "Before");
  add(document.createElement("span"), "tag right", "After");
  add(document.createElement("span"), "knob", "↔");
  slider.type = "range";
  slider.step = "0.1";
  slider.value = "50";
  slider.setAttribute("aria-label", "Compare before and after");
  slider.addEventListener("input", () => stage.style.setProperty("--split", `${slider.value}%`));
  stage.append(slider);
  const compare = pictures.querySelector(".compare");
  compare.append(stage);
  compare.hidden = false;
  pictures.classList.add("live");
}
