#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "core/check.h"
#include "core/files.h"
#include "dataset/panoptic.h"
#include "dataset/panoptic_internal.h"
#include "geometry/rig_io.h"

namespace mvstudio::dataset {
namespace {

using geometry::Camera;
using geometry::LensModel;
using geometry::RigCamera;
using internal::Json;
using internal::JsonView;
using internal::NumberText;

/// x_in_ours = OursFromPanoptic() * x_in_panoptic / 100.
Eigen::Matrix3d OursFromPanoptic() {
  Eigen::Matrix3d axes;
  axes << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return axes;
}

Eigen::Matrix3d ReadMatrix3(const JsonView& json) {
  if (json.ArraySize() != 3) json.Fail("must be a 3x3 matrix");
  Eigen::Matrix3d matrix;
  for (size_t r = 0; r < 3; ++r) {
    if (json[r].ArraySize() != 3) json[r].Fail("must hold 3 numbers");
    for (size_t c = 0; c < 3; ++c) matrix(r, c) = json[r][c].Number();
  }
  return matrix;
}

/// 3x1 nested as CMU writes it, or a flat list of three.
Eigen::Vector3d ReadVector3(const JsonView& json) {
  if (json.ArraySize() != 3) json.Fail("must hold 3 numbers");
  Eigen::Vector3d vector;
  for (size_t i = 0; i < 3; ++i) vector[i] = json[i].value().is_array() ? json[i][size_t{0}].Number() : json[i].Number();
  return vector;
}

void ReadIntrinsics(const JsonView& json, Camera* camera) {
  const JsonView size = json["resolution"];
  if (size.ArraySize() != 2) size.Fail("must be [width, height]");
  camera->width_px = size[size_t{0}].Int();
  camera->height_px = size[size_t{1}].Int();
  if (camera->width_px <= 0 || camera->height_px <= 0) size.Fail("must be positive");
  const Eigen::Matrix3d k = ReadMatrix3(json["K"]);
  if (!(k(0, 0) > 0 && k(1, 1) > 0)) json["K"].Fail("focal lengths must be positive");
  if (k(1, 0) != 0 || k(2, 0) != 0 || k(2, 1) != 0 || k(2, 2) != 1)
    json["K"].Fail("must have the form [[fx,0,cx],[0,fy,cy],[0,0,1]]");
  if (k(0, 1) != 0) json["K"].Fail("skew K[0][1] is not supported, it must be 0");
  const JsonView dist = json["distCoef"];
  if (dist.ArraySize() != 5) dist.Fail("must hold 5 numbers: k1, k2, p1, p2, k3");
  Eigen::VectorXd params(9);
  params.head<4>() << k(0, 0), k(1, 1), k(0, 2), k(1, 2);
  for (size_t i = 0; i < 5; ++i) params[4 + i] = dist[i].Number();
  const bool distorted = !params.tail<5>().isZero(0);
  camera->model = distorted ? LensModel::kBrown5 : LensModel::kPinhole;
  camera->params = distorted ? params : Eigen::VectorXd(params.head<4>());
}

RigCamera ReadCamera(const JsonView& json, double* drift) {
  RigCamera camera;
  camera.camera.name = json["name"].Text();
  if (camera.camera.name.empty() || camera.camera.name.find('/') != std::string::npos || camera.camera.name[0] == '.') {
    json["name"].Fail("'" + camera.camera.name + "' cannot be a folder's name");
  }
  ReadIntrinsics(json, &camera.camera);
  const Eigen::Matrix3d r = ReadMatrix3(json["R"]);
  if (!(r.determinant() > 0)) json["R"].Fail("is not a rotation: its determinant is " + NumberText(r.determinant()));
  camera.cam_from_world.rotation = geometry::NearestRotation(r * OursFromPanoptic().transpose(), drift);
  if (*drift > 1e-3) json["R"].Fail("is not a rotation: it is " + NumberText(*drift) + " from the nearest one");
  camera.cam_from_world.translation = ReadVector3(json["t"]) / 100.0;
  return camera;
}

/// The shortest decimal of centimetres whose hundredth is exactly `metres`: files survive a round trip unchanged.
double Centimetres(double metres) {
  char text[32];
  for (int digits = 9; digits <= 17; ++digits) {
    std::snprintf(text, sizeof(text), "%.*g", digits, metres * 100.0);
    const double cm = std::strtod(text, nullptr);
    if (cm / 100.0 == metres) return cm;
  }
  return metres * 100.0;
}

/// k1, k2, p1, p2, k3.
Eigen::Matrix<double, 5, 1> BrownCoefficients(const Camera& camera) {
  Eigen::Matrix<double, 5, 1> dist = Eigen::Matrix<double, 5, 1>::Zero();
  const Eigen::VectorXd k = camera.params.tail(camera.params.size() - 4);
  const bool plain_rational =
      (camera.model == LensModel::kRational8 || camera.model == LensModel::kThinPrism12) && k.tail(k.size() - 5).isZero(0);
  if (camera.model == LensModel::kPinholeP) {
    dist.segment<2>(2) = k;
  } else if (camera.model == LensModel::kBrown1P) {
    dist << k[0], 0, k[1], k[2], 0;
  } else if (!IsWide(camera.model) && (k.size() <= 5 || plain_rational)) {
    const Eigen::Index count = std::min<Eigen::Index>(k.size(), 5);
    dist.head(count) = k.head(count);
  } else {
    throw UsageError("camera " + camera.name + ": its lens model " + std::string(ToString(camera.model)) +
                     " cannot be written in Panoptic's five coefficients; calibrate with --model brown5");
  }
  return dist;
}

std::string MatrixText(const Eigen::Matrix3d& m) {
  std::string text = "[\n";
  for (int r = 0; r < 3; ++r) {
    text += "\t\t\t\t[" + NumberText(m(r, 0)) + "," + NumberText(m(r, 1)) + "," + NumberText(m(r, 2)) + "]" +
            (r < 2 ? ",\n" : "\n");
  }
  return text + "\t\t\t]";
}

std::string CameraText(const RigCamera& camera) {
  const Camera& c = camera.camera;
  int panel = 0, node = 0;
  MVS_CHECK(ParsePanopticName(c.name, &panel, &node), "camera name '" << c.name << "' is not of the form 00_00");
  const auto dist = BrownCoefficients(c);
  const Eigen::Matrix3d r = camera.cam_from_world.rotation.toRotationMatrix() * OursFromPanoptic();
  const Eigen::Vector3d& t = camera.cam_from_world.translation;
  const std::string type = panel == 0 ? "hd" : panel == 50 ? "kinect-color" : "vga";
  std::string text = "\t\t{\n\t\t\t\"name\": \"" + c.name + "\",\n\t\t\t\"type\": \"" + type + "\",\n";
  text += "\t\t\t\"resolution\": [" + std::to_string(c.width_px) + "," + std::to_string(c.height_px) + "],\n";
  text += "\t\t\t\"panel\": " + std::to_string(panel) + ",\n\t\t\t\"node\": " + std::to_string(node) + ",\n";
  text += "\t\t\t\"K\": " + MatrixText(c.K()) + ",\n\t\t\t\"distCoef\": [";
  for (int i = 0; i < 5; ++i) text += (i ? "," : "") + NumberText(dist[i]);
  text += "],\n\t\t\t\"R\": " + MatrixText(r) + ",\n\t\t\t\"t\": [\n";
  for (int i = 0; i < 3; ++i) text += "\t\t\t\t[" + NumberText(Centimetres(t[i])) + "]" + (i < 2 ? ",\n" : "\n");
  return text + "\t\t\t]\n\t\t}";
}

}  // namespace

geometry::RigCamera internal::ReadPanopticCamera(const JsonView& json, double* drift) { return ReadCamera(json, drift); }

bool ParsePanopticName(const std::string& name, int* panel, int* node) {
  if (name.size() != 5 || name[2] != '_') return false;
  for (const size_t i : {0, 1, 3, 4}) {
    if (name[i] < '0' || name[i] > '9') return false;
  }
  *panel = (name[0] - '0') * 10 + name[1] - '0';
  *node = (name[3] - '0') * 10 + name[4] - '0';
  return true;
}

geometry::Rig ReadPanopticCalibration(const std::string& path) {
  const Json json = internal::ParseJsonFile(path);
  const JsonView cameras = JsonView(path, json)["cameras"];
  geometry::Rig rig;
  rig.gauge = "Panoptic file " + std::filesystem::path(path).filename().string();
  std::set<std::string> names;
  for (size_t i = 0; i < cameras.ArraySize(); ++i) {
    double drift = 0;
    rig.cameras.push_back(ReadCamera(cameras[i], &drift));
    const std::string& name = rig.cameras.back().camera.name;
    if (!names.insert(name).second) cameras[i]["name"].Fail("'" + name + "' is there twice");
  }
  if (rig.cameras.empty()) cameras.Fail("is empty");
  return rig;
}

void WritePanopticCalibration(const geometry::Rig& rig, const std::string& path, const std::string& source) {
  std::string text = "{\n\t\"calibDataSource\": " + Json(source).dump() + ",\n\t\"cameras\": [\n";
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    Validate(rig.cameras[i].camera);
    text += CameraText(rig.cameras[i]) + (i + 1 < rig.cameras.size() ? ",\n" : "\n");
  }
  WriteFileAtomic(path, text + "\t]\n}\n");
}

geometry::Rig ReadAnyCalibration(const std::string& path) {
  const Json json = internal::ParseJsonFile(path);
  return json.is_object() && json.contains("schema") ? geometry::ReadRig(path) : ReadPanopticCalibration(path);
}

}  // namespace mvstudio::dataset
