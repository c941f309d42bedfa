#include "geometry/rig/rig_io.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/json_view.h"
#include "core/label.h"
#include "core/log.h"
#include "geometry/rig/file_keys.h"
#include "geometry/rig/message_text.h"

namespace mvstudio::geometry {
namespace {

using internal::Json;
constexpr size_t kMaxDepth = 16;
constexpr int kMaxSizePx = 1 << 20;

using internal::Shown;

/// Keys that nobody asks for: the first few are named, the others counted.
class UnknownKeys {
 public:
  explicit UnknownKeys(const std::string& path) : path_(path) {}

  /// Throws FormatError for a key that says that the numbers mean something else.
  void Add(const std::string& where, const std::string& key, const Json& value) {
    UnusedKeys(path_, 1).Add(where.empty() ? key : where + "." + key, key,
                             value.is_string() ? value.get<std::string>() : value.dump());
    if (++count_ > kMostNamed) return;
    Log(LogLevel::kWarning,
        path_ + ": " + (where.empty() ? "" : where + ".") + JsonEscaped<Json>(key) + ": unknown key, ignored");
  }
  void Finish() const {
    if (count_ <= kMostNamed) return;
    Log(LogLevel::kWarning, path_ + ": and " + std::to_string(count_ - kMostNamed) + " more unknown keys, ignored");
  }

 private:
  static constexpr size_t kMostNamed = 8;
  const std::string& path_;
  size_t count_ = 0;
};

/// A value of the document. Keys that nobody asks for go to `unknown`.
class Node : public BasicJsonView<Json> {
 public:
  Node(const BasicJsonView<Json>& view, UnknownKeys* unknown) : BasicJsonView<Json>(view), unknown_(unknown) {}

  /// What is missing is a fault of the object.
  Node At(const std::string& key) const {
    if (!Has(key.c_str())) Fail("key '" + key + "' is missing");
    return {(*this)[key.c_str()], unknown_};
  }
  Node At(size_t index) const { return {(*this)[index], unknown_}; }

  void RequireObject(std::initializer_list<const char*> known) const {
    if (!value().is_object()) Fail("must be an object");
    for (const auto& [key, ignored] : value().items()) {
      bool is_known = false;
      for (const char* name : known) is_known |= key == name;
      if (!is_known) unknown_->Add(where(), key, ignored);
    }
  }
  void RequireSize(size_t size) const {
    if (ArraySize() != size) Fail(std::to_string(ArraySize()) + " entries, " + std::to_string(size) + " expected");
  }
  int SizePx() const {
    if (!value().is_number_integer()) Fail("must be a whole number of pixels");
    const double number = Number();
    if (!(number >= 1 && number <= kMaxSizePx)) Fail("image size " + value().dump() + " px is out of range");
    return static_cast<int>(number);
  }
  Eigen::VectorXd Vector(size_t size) const {
    RequireSize(size);
    const std::vector<double> numbers = Numbers();
    return Eigen::Map<const Eigen::VectorXd>(numbers.data(), static_cast<Eigen::Index>(size));
  }
  /// Row i holds `size_of_row(i)` entries; known before a matrix is made for them.
  template <class SizeOfRow>
  void RequireRows(size_t size, SizeOfRow size_of_row) const {
    RequireSize(size);
    for (size_t i = 0; i < size; ++i) At(i).RequireSize(size_of_row(i));
  }
  Eigen::MatrixXd SquareMatrix(size_t size) const {
    RequireRows(size, [size](size_t) { return size; });
    Eigen::MatrixXd matrix(size, size);
    for (size_t i = 0; i < size; ++i) matrix.row(static_cast<Eigen::Index>(i)) = At(i).Vector(size).transpose();
    return matrix;
  }

 private:
  UnknownKeys* unknown_;
};

Eigen::Quaterniond ReadRotation(const Node& node) {
  const Eigen::Vector4d xyzw = node.Vector(4);
  const double norm = xyzw.stableNorm();
  if (std::abs(norm - 1) > 1e-3) node.Fail("the quaternion's norm is " + std::to_string(norm) + ", it must be 1");
  // Numbers of our own come back bit for bit; rounded ones, typed by hand, are put back on the unit sphere.
  return Eigen::Quaterniond(std::abs(norm - 1) < 1e-9 ? xyzw : Eigen::Vector4d(xyzw / norm));
}

Eigen::MatrixXd ReadCovariance(const Node& node, size_t size) {
  const Eigen::MatrixXd covariance = node.SquareMatrix(size);
  if (covariance.diagonal().minCoeff() < 0) node.Fail("a variance is negative");
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
      if (std::abs(covariance(i, j) - covariance(j, i)) > 1e-6 * scale) node.Fail("the covariance is not symmetric");
    }
  }
  return covariance;
}

SplineGrid ReadSplineGrid(const Node& node) {
  node.RequireObject({"order", "cols", "rows", "fov_x_deg"});
  return {node.At("order").PlainInt(), node.At("cols").PlainInt(), node.At("rows").PlainInt(), node.At("fov_x_deg").PlainInt()};
}

/// fx, fy, cx, cy and the distortion by name; the control points of a splined lens in one list.
void ReadIntrinsics(const Node& node, Camera* camera) {
  const bool splined = camera->model == LensModel::kSplined;
  const std::vector<std::string> names = splined ? ParamNames(LensModel::kPinhole) : ParamNames(camera->model);
  if (!node.value().is_object()) node.Fail("must be an object with fx, fy, cx, cy and the distortion");
  camera->params.resize(NumParams(*camera));
  for (size_t i = 0; i < names.size(); ++i) camera->params[static_cast<Eigen::Index>(i)] = node.At(names[i]).Number();
  if (splined) camera->params.tail(camera->params.size() - 4) = node.At("control_points").Vector(camera->params.size() - 4);
  for (const auto& [key, ignored] : node.value().items()) {
    if (std::find(names.begin(), names.end(), key) == names.end() && !(splined && key == "control_points")) {
      node.Fail(Shown(key) + " is no parameter of the model " + std::string(ToString(camera->model)));
    }
  }
  for (const char* focal : {"fx", "fy"}) {
    if (!(node.At(focal).Number() > 0)) node.At(focal).Fail("a focal length must be positive");
  }
  const std::string why = WhyInvalidLens(*camera);
  if (!why.empty()) node.Fail(why);
}

void ReadLens(const Node& node, Camera* camera) {
  const std::string name = node.At("model").Text();
  const std::optional<LensModel> model = LensModelFromString(name);
  if (!model) node.At("model").Fail("unknown lens model " + Shown(name) + "; known are " + LensModelNames());
  camera->model = *model;
  if (*model == LensModel::kSplined) {
    camera->spline = ReadSplineGrid(node.At("spline"));
    const std::string why = WhyInvalidGrid(camera->spline);
    if (!why.empty()) node.At("spline").Fail(why);
  } else if (node.Has("spline")) {
    node.At("spline").Fail("only the model splined has a control grid");
  }
  ReadIntrinsics(node.At("intrinsics"), camera);
}

TimeOffset ReadTimeOffset(const Node& node) {
  constexpr double kMaxFrames = 1e6;  // as in sync.json
  constexpr double kMaxRate = 0.5;    // frames per frame
  node.RequireObject({"frames", "sigma_frames", "rate", "sigma_rate"});
  TimeOffset offset{node.At("frames").Number(), node.At("sigma_frames").Number()};
  if (node.Has("rate")) offset.rate = node.At("rate").Number();
  if (node.Has("sigma_rate")) offset.sigma_rate = node.At("sigma_rate").Number();
  if (std::abs(offset.rate) > kMaxRate) node.At("rate").Fail("must lie within 0.5 frames per frame");
  if (offset.sigma_rate < 0) node.At("sigma_rate").Fail("must not be negative");
  if (std::abs(offset.frames) > kMaxFrames) node.At("frames").Fail("must lie within 1e6 frames");
  if (offset.sigma_frames < 0) node.At("sigma_frames").Fail("must not be negative");
  return offset;
}

RigBoard ReadBoard(const Node& node) {
  node.RequireObject({"board", "bend_m", "stretch"});
  RigBoard board;
  board.board = node.At("board").Text();
  if (node.Has("bend_m")) board.bend_m = node.At("bend_m").Vector(2);
  if (node.Has("stretch")) board.stretch = node.At("stretch").Vector(2);
  constexpr double kMaxStretch = 0.5;  // beyond it no board is left
  if (!(board.stretch.cwiseAbs().maxCoeff() < kMaxStretch)) node.At("stretch").Fail("must lie within 0.5");
  return board;
}

RigCamera ReadCamera(const Node& node) {
  node.RequireObject({"name", "model", "size_px", "spline", "intrinsics", "cam_from_world", "intrinsics_covariance",
                      "cam_from_world_covariance", "time_offset"});
  RigCamera camera;
  camera.camera.name = node.At("name").Text();
  const std::string why = WhyNotALabel(camera.camera.name);
  if (!why.empty()) node.At("name").Fail(Shown(camera.camera.name) + " " + why + ": it cannot be a camera's name");
  const Node size = node.At("size_px");
  size.RequireSize(2);
  camera.camera.width_px = size.At(0).SizePx();
  camera.camera.height_px = size.At(1).SizePx();
  ReadLens(node, &camera.camera);
  const Node transform = node.At("cam_from_world");
  transform.RequireObject({"rotation_xyzw", "translation"});
  camera.cam_from_world.rotation = ReadRotation(transform.At("rotation_xyzw"));
  camera.cam_from_world.translation = transform.At("translation").Vector(3);
  if (node.Has("intrinsics_covariance")) {
    camera.params_covariance = ReadCovariance(node.At("intrinsics_covariance"), camera.camera.params.size());
  }
  if (node.Has("cam_from_world_covariance")) {
    camera.cam_from_world_covariance = ReadCovariance(node.At("cam_from_world_covariance"), 6);
  }
  if (node.Has("time_offset")) camera.time_offset = ReadTimeOffset(node.At("time_offset"));
  return camera;
}

/// Rows of the lower triangle.
Eigen::MatrixXd ReadJointCovariance(const Node& node, const Rig& rig) {
  Eigen::Index size = 0;
  for (const RigCamera& camera : rig.cameras) size += camera.camera.params.size() + 6;
  node.RequireRows(static_cast<size_t>(size), [](size_t row) { return row + 1; });
  Eigen::MatrixXd joint(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    joint.row(i).head(i + 1) = node.At(static_cast<size_t>(i)).Vector(static_cast<size_t>(i + 1)).transpose();
    joint.col(i).head(i + 1) = joint.row(i).head(i + 1).transpose();
  }
  return joint;
}

}  // namespace

Rig RigFromJsonText(const std::string& text, const std::string& path_for_messages) {
  const Json json = JsonFromText<Json>(text, {kMaxDepth, true}, path_for_messages);
  UnknownKeys unknown(path_for_messages);
  const Node root(BasicJsonView<Json>(path_for_messages, json), &unknown);
  root.RequireObject({"schema", "unit", "gauge", "boards", "cameras", "joint_covariance_lower", "joint_covariance_left_out"});
  const std::string schema = root.At("schema").Text();
  if (schema != kCalibrationSchema) root.At("schema").Fail(Shown(schema) + ", this version reads " + kCalibrationSchema);
  if (root.At("unit").Text() != "m") root.At("unit").Fail(Shown(root.At("unit").Text()) + ", this schema is in \"m\"");
  Rig rig;
  if (root.Has("gauge")) rig.gauge = GaugeFromText(root.At("gauge").Text());
  const Node cameras = root.At("cameras");
  if (cameras.ArraySize() == 0) cameras.Fail("must be a list of at least one camera");
  std::set<std::string> names;
  for (size_t i = 0; i < cameras.ArraySize(); ++i) {
    RigCamera camera = ReadCamera(cameras.At(i));
    if (!names.insert(camera.camera.name).second) cameras.At(i).At("name").Fail("'" + camera.camera.name + "' is used twice");
    rig.cameras.push_back(std::move(camera));
  }
  if (root.Has("boards")) {
    const Node boards = root.At("boards");
    for (size_t i = 0; i < boards.ArraySize(); ++i) rig.boards.push_back(ReadBoard(boards.At(i)));
  }
  unknown.Finish();
  if (root.Has("joint_covariance_lower")) rig.joint_covariance = ReadJointCovariance(root.At("joint_covariance_lower"), rig);
  return rig;
}

Rig ReadRig(const std::string& path) { return RigFromJsonText(ReadFile(path), path); }

}  // namespace mvstudio::geometry
