#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "stages/result.h"
#include "stages/view/view_page.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json HundredthsJson(double px) { return FiniteOrNull(std::round(px * 100) / 100); }

ordered_json JointsPxJson(const JointsPx& joints) {
  ordered_json list = ordered_json::array();
  for (const Eigen::Vector2d& px : joints) list.push_back(HundredthsJson(px.x())), list.push_back(HundredthsJson(px.y()));
  return list;
}

int NumFound(const Scene& scene, int step) {
  const auto people = scene.joints.find(step);
  int found = 0;
  if (people == scene.joints.end()) return 0;
  for (const auto& [person, pose] : people->second)
    found += static_cast<int>(std::count(pose.valid.begin(), pose.valid.end(), true));
  return found;
}

ordered_json SceneViewJson(const SceneView& view) {
  ordered_json json{{"frame", view.frame < 0 ? ordered_json() : ordered_json(view.frame)},
                    {"projected", ordered_json::array()},
                    {"people", ordered_json::array()},
                    {"detected", ordered_json::array()},
                    {"residuals", ordered_json::array()},
                    {"median_px", HundredthsJson(MedianResidualPx(view))}};
  for (const auto& [person, px] : view.projected) {
    json["projected"].push_back(JointsPxJson(px));
    json["people"].push_back(person);
  }
  for (const JointsPx& px : view.detected) json["detected"].push_back(JointsPxJson(px));
  for (const auto& [from, to] : view.residuals) json["residuals"].push_back(JointsPxJson({from, to}));
  return json;
}

ordered_json LinesJson(const std::vector<OutlinePx>& lines) {
  ordered_json list = ordered_json::array();
  for (const OutlinePx& line : lines) {
    ordered_json numbers = ordered_json::array();
    for (const Eigen::Vector2d& px : line) {
      for (const double v : {px.x(), px.y()}) numbers.push_back(FiniteOrNull(std::round(v * 10) / 10));
    }
    list.push_back(std::move(numbers));
  }
  return list;
}

/// Of the images that were held out at a time step; -1: none was.
ordered_json LowestSsim(const Scene& scene, int step) {
  const auto images = scene.held_out.find(step);
  if (images == scene.held_out.end()) return -1;
  double lowest = std::numeric_limits<double>::quiet_NaN();
  for (const auto& [camera, ssim] : images->second) lowest = std::fmin(lowest, ssim);
  return FiniteOrNull(std::round(lowest * 1e4) / 1e4);
}

/// Names are arbitrary bytes.
std::string TextOf(const ordered_json& json) { return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace); }

}  // namespace

std::string ViewSceneJson(const Scene& scene, const MarksReader& marks, bool has_report, bool has_avatar) {
  ordered_json json{{"title", scene.title},
                    {"kind", scene.kind},
                    {"fps_hz", scene.fps_hz},
                    {"has_report", has_report},
                    {"cameras", ordered_json::array()},
                    {"bones", scene.skeleton.bones},
                    {"joints", scene.skeleton.joints},
                    {"detected_bones", scene.detected_skeleton.bones},
                    {"detected_joints", scene.detected_skeleton.joints},
                    {"has_masks", marks.has_masks()},
                    {"has_body", marks.has_body()},
                    {"has_boards", marks.has_boards()},
                    {"has_avatar", has_avatar},
                    {"held_out", ordered_json::object()},
                    {"steps", ordered_json::array()}};
  for (const SceneCamera& camera : scene.cameras) {
    const geometry::Camera* lens =
        camera.rig_idx < 0 ? nullptr : &scene.rig.cameras[static_cast<size_t>(camera.rig_idx)].camera;
    json["cameras"].push_back({{"name", camera.name},
                               {"width", lens ? lens->width_px : 0},
                               {"height", lens ? lens->height_px : 0},
                               {"has_footage", !camera.footage.empty()}});
  }
  for (const int step : scene.steps) {
    const auto error = scene.error_px.find(step);
    json["steps"].push_back({step, error == scene.error_px.end() ? ordered_json() : HundredthsJson(error->second),
                             NumFound(scene, step), LowestSsim(scene, step)});
  }
  for (const auto& [step, images] : scene.held_out) {
    ordered_json& of_step = json["held_out"][std::to_string(step)] = ordered_json::object();
    for (const auto& [camera, ssim] : images) of_step[camera] = FiniteOrNull(std::round(ssim * 1e4) / 1e4);
  }
  json["scored"] = ordered_json::object();
  for (const auto& [step, images] : scene.scored)
    for (const auto& [camera, path] : images) json["scored"][std::to_string(step)].push_back(camera);
  return TextOf(json);
}

std::string ViewMarksJson(const ViewMarks& marks) {
  return TextOf({{"mask", LinesJson(marks.mask)},
                 {"body", LinesJson(marks.body)},
                 {"boards", LinesJson(marks.boards)},
                 {"x_axes", LinesJson(marks.x_axes)},
                 {"y_axes", LinesJson(marks.y_axes)}});
}

std::string ViewStepJson(const Scene& scene, int step) {
  ordered_json json{{"step", step}, {"cameras", ordered_json::array()}};
  for (size_t c = 0; c < scene.cameras.size(); ++c) json["cameras"].push_back(SceneViewJson(ViewAt(scene, c, step)));
  return TextOf(json);
}

}  // namespace mvstudio::stages
