#include "stages/click/click_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/csv.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "stages/result.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

constexpr char kPlace[] = "the page's clicks";

std::string SizeOf(int width_px, int height_px) { return std::to_string(width_px) + "x" + std::to_string(height_px); }

int IndexOf(const ordered_json& click, const char* key, size_t count) {
  const auto found = click.find(key);
  if (found == click.end() || !found->is_number_integer()) throw FormatError(kPlace, key, "must be a whole number");
  const auto index = found->get<int64_t>();
  if (index < 0 || index >= static_cast<int64_t>(count)) throw FormatError(kPlace, key, "there is no such " + std::string(key));
  return static_cast<int>(index);
}

double PlaceOf(const ordered_json& click, const char* key, int size_px) {
  const auto found = click.find(key);
  if (found == click.end() || !found->is_number()) throw FormatError(kPlace, key, "must be a number");
  const auto value = found->get<double>();
  if (!(value >= -0.5 && value <= size_px - 0.5)) throw FormatError(kPlace, key, "is outside the image");
  return value;
}

ordered_json PixelJson(const Eigen::Vector2d& px) { return {FiniteOrNull(px.x()), FiniteOrNull(px.y())}; }

ordered_json FitJson(const ClickFit& fit) {
  ordered_json json{{"status", std::string(ToString(fit.status))},
                    {"message", fit.message},
                    {"num_clicks", fit.num_clicks},
                    {"rms_px", FiniteOrNull(fit.rms_px)},
                    {"leave_one_out_px", FiniteOrNull(fit.leave_one_out_px)},
                    {"rejected", fit.rejected},
                    {"residuals", ordered_json::object()},
                    {"predicted", ordered_json::object()}};
  for (const auto& [point, px] : fit.residual_px) json["residuals"][std::to_string(point)] = PixelJson(px);
  for (const auto& [point, px] : fit.predicted_px) json["predicted"][std::to_string(point)] = PixelJson(px);
  return json;
}

ordered_json FitsJson(const ClickScene& scene, const calib::PointResectionOptions& options) {
  ordered_json fits = ordered_json::array();
  for (size_t c = 0; c < scene.cameras.size(); ++c) fits.push_back(FitJson(FitClicks(scene, static_cast<int>(c), options)));
  return fits;
}

ordered_json ClicksJson(const ClickScene& scene, const calib::PointResectionOptions& options) {
  ordered_json json{{"revision", scene.revision}, {"clicks", ordered_json::array()}};
  for (const auto& [key, px] : scene.clicks)
    json["clicks"].push_back({{"camera", key.first}, {"point", key.second}, {"x", px.x()}, {"y", px.y()}});
  json["fits"] = FitsJson(scene, options);
  return json;
}

/// Names are arbitrary bytes.
std::string Dump(const ordered_json& json) { return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace); }

void AddResiduals(const ClickScene& scene, const std::vector<calib::PointClick>& clicks, const calib::PointResection& placed,
                  ClickFit* fit) {
  for (size_t i = 0; i < clicks.size(); ++i) {
    fit->residual_px[clicks[i].point_idx] = -placed.residuals_px.col(static_cast<Eigen::Index>(i));
    if (placed.rejected[i]) fit->rejected.push_back(clicks[i].point_idx);
  }
  const geometry::Camera& lens = placed.cameras[0];
  const geometry::Projector projector(lens);
  for (Eigen::Index p = 0; p < scene.x_in_world.cols(); ++p) {
    const auto seen = projector.Project(placed.rig_from_world * Eigen::Vector3d(scene.x_in_world.col(p)));
    if (seen.status == Status::kOk && geometry::InImage(lens, seen.px)) fit->predicted_px[static_cast<int>(p)] = seen.px;
  }
}

}  // namespace

void AddCamera(const std::string& name, const Image& image, const std::optional<geometry::Camera>& lens, ClickScene* scene) {
  for (const ClickCamera& other : scene->cameras) {
    if (other.name == name) throw UsageError("option 'camera' " + name + " is given twice");
  }
  if (lens && (lens->width_px != image.width || lens->height_px != image.height)) {
    throw UsageError("camera " + name + ": its image is " + SizeOf(image.width, image.height) + ", the calibration says " +
                     SizeOf(lens->width_px, lens->height_px));
  }
  constexpr int kQuality = 95;
  scene->cameras.push_back({name, image.width, image.height, dataset::EncodeImage(image, "image.jpg", kQuality), lens});
}

std::vector<std::string> AddPoints(const calib::ScenePoints& points, ClickScene* scene) {
  scene->names = points.names;
  scene->x_in_world = points.x_in_world;
  std::vector<std::string> others;
  for (const calib::PointClick& click : points.clicks) {
    const std::string& camera = points.cameras[static_cast<size_t>(click.camera_idx)];
    const auto found =
        std::find_if(scene->cameras.begin(), scene->cameras.end(), [&](const ClickCamera& c) { return c.name == camera; });
    if (found != scene->cameras.end()) {
      scene->clicks[{static_cast<int>(found - scene->cameras.begin()), click.point_idx}] = click.px;
    } else if (std::find(others.begin(), others.end(), camera) == others.end()) {
      others.push_back(camera);
    }
  }
  return others;
}

std::string SceneJsonText(const ClickScene& scene, const calib::PointResectionOptions& options) {
  ordered_json json{{"cameras", ordered_json::array()}, {"points", ordered_json::array()}};
  for (const ClickCamera& camera : scene.cameras) {
    json["cameras"].push_back({{"name", camera.name},
                               {"width", camera.width_px},
                               {"height", camera.height_px},
                               {"has_lens", camera.lens.has_value()}});
  }
  for (size_t p = 0; p < scene.names.size(); ++p) {
    const Eigen::Vector3d x = scene.x_in_world.col(static_cast<Eigen::Index>(p));
    json["points"].push_back(
        {{"name", scene.names[p]}, {"x", FiniteOrNull(x.x())}, {"y", FiniteOrNull(x.y())}, {"z", FiniteOrNull(x.z())}});
  }
  json.update(ClicksJson(scene, options));
  return Dump(json);
}

SentClicks ReadSentClicks(const std::string& json_text, const ClickScene& scene) {
  const ordered_json json = ordered_json::parse(json_text, nullptr, false);
  const auto list = json.is_object() ? json.find("clicks") : json.end();
  if (!json.is_object() || list == json.end() || !list->is_array())
    throw FormatError(kPlace, "", "a list 'clicks' was expected");
  SentClicks sent;
  const auto revision = json.find("revision");
  if (revision != json.end() && revision->is_number_integer()) sent.revision = revision->get<int64_t>();
  for (const ordered_json& click : *list) {
    if (!click.is_object()) throw FormatError(kPlace, "clicks", "must hold objects");
    const int camera = IndexOf(click, "camera", scene.cameras.size()), point = IndexOf(click, "point", scene.names.size());
    const ClickCamera& of = scene.cameras[static_cast<size_t>(camera)];
    const Eigen::Vector2d px(PlaceOf(click, "x", of.width_px), PlaceOf(click, "y", of.height_px));
    if (!sent.clicks.insert({{camera, point}, px}).second) throw FormatError(kPlace, "point", "is clicked twice in one camera");
  }
  return sent;
}

ClickFit FitClicks(const ClickScene& scene, int camera_idx, const calib::PointResectionOptions& options) {
  const ClickCamera& camera = scene.cameras.at(static_cast<size_t>(camera_idx));
  ClickFit fit;
  fit.rms_px = fit.leave_one_out_px = std::numeric_limits<double>::quiet_NaN();
  std::vector<calib::PointClick> clicks;
  for (const auto& [key, px] : scene.clicks) {
    if (key.first == camera_idx) clicks.push_back({0, key.second, px});
  }
  fit.num_clicks = static_cast<int>(clicks.size());
  constexpr int kLeast = 4;
  if (!scene.x_in_world.array().isFinite().any()) {
    fit.message =
        "the points have no places: the cameras are placed by one another (calibrate, option 'scene-points', option "
        "'length')";
    return fit;
  }
  if (!camera.lens) {
    fit.message = "its lens is not known: give option 'calib'";
    return fit;
  }
  if (fit.num_clicks < kLeast) {
    fit.message = Format("%d of the %d clicks that place a camera", fit.num_clicks, kLeast);
    return fit;
  }
  geometry::RigCamera alone;
  alone.camera = *camera.lens;
  const calib::PointResection placed = calib::ResectFromPoints({alone}, clicks, scene.x_in_world, options);
  fit.status = placed.status;
  fit.message = placed.message;
  if (placed.status != Status::kOk) return fit;
  fit.rms_px = placed.rms_px;
  fit.leave_one_out_px = placed.leave_one_out_px;
  AddResiduals(scene, clicks, placed, &fit);
  return fit;
}

std::string ClicksJsonText(const ClickScene& scene, const calib::PointResectionOptions& options) {
  return Dump(ClicksJson(scene, options));
}

std::string ClicksCsv(const ClickScene& scene) {
  std::string text = "camera,point,x_px,y_px\n";
  for (const auto& [key, px] : scene.clicks) {
    text += CsvCell(scene.cameras[static_cast<size_t>(key.first)].name) + "," +
            CsvCell(scene.names[static_cast<size_t>(key.second)]) + Format(",%.3f,%.3f\n", px.x(), px.y());
  }
  return text;
}

}  // namespace mvstudio::stages
