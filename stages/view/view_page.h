#pragma once

#include <string>

#include "stages/view/scene.h"

/// The page that shows frames: four files that name nothing else, and what they ask for.
namespace mvstudio::stages {

const char* ViewPageHtml();    ///< loads view.css, view.js and icon.svg from beside it
const char* ViewPageStyle();   ///< view.css
const char* ViewPageIcon();    ///< icon.svg
const char* ViewPageScript();  ///< view.js; asks for scene.json, step/N.json, image/C/N.jpg and thumb/C/N.jpg

/// {"title", "kind", "fps_hz", "has_report", "cameras": [{name, width, height, has_footage}], "bones", "detected_bones",
/// "joints": names, "steps": [time step, median rms px or null, joints found]}.
std::string ViewSceneJson(const Scene& scene, bool has_report);
/// Of each camera: {"frame", "projected": [[x, y, …] a person], "detected": […], "residuals": [[x, y, x, y]], "median_px"}; a
/// joint that is not there is null, null.
std::string ViewStepJson(const Scene& scene, int step);

}  // namespace mvstudio::stages
