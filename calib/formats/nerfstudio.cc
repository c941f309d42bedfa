#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "calib/board/pixel_origin.h"
#include "calib/formats/document.h"
#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"
#include "calib/formats/writers.h"
#include "core/disk/files.h"
#include "core/error.h"

/// Camera axes are OpenGL's: x right, y up, z backward; transform_matrix is world_from_cam.
/// https://docs.nerf.studio/quickstart/data_conventions.html
namespace mvstudio::calib {
namespace {

using internal::ValueView;

/// A key of the frame, else of the whole file.
class FrameKeys {
 public:
  FrameKeys(const ValueView& frame, const ValueView& root) : frame_(frame), root_(root) {}
  bool Has(const char* key) const { return frame_.Has(key) || root_.Has(key); }
  ValueView operator[](const char* key) const { return frame_.Has(key) || !root_.Has(key) ? frame_[key] : root_[key]; }
  double Number(const char* key, double fallback) const { return Has(key) ? (*this)[key].Number() : fallback; }
  /// What the frame says about its lens, else the file.
  geometry::LensKind LensKindOf(const ReadOptions& options) const {
    geometry::LensWords of_frame, of_file;
    internal::AddLensWords(frame_, &of_frame);
    internal::AddLensWords(root_, &of_file);
    const bool own = of_frame.kind() != geometry::LensKind::kUnsaid;
    return internal::LensKindOf(own ? of_frame : of_file, options, frame_.place());
  }

 private:
  const ValueView &frame_, &root_;
};

Eigen::Vector2d ReadSize(const FrameKeys& keys, const ReadOptions& options, const ValueView& frame) {
  if (keys.Has("w") && keys.Has("h")) return {keys["w"].Number(), keys["h"].Number()};
  if (keys.Has("width") && keys.Has("height")) return {keys["width"].Number(), keys["height"].Number()};
  if (options.width_px <= 0 || options.height_px <= 0) {
    throw UsageError(frame.place().path + ": the file does not give the image size; pass option 'size' WIDTHxHEIGHT");
  }
  return {options.width_px, options.height_px};
}

/// A matrix in rows or as one list; four numbers are fx, fy, cx, cy, and of a 4x4 matrix the first three rows and columns
/// count. None: it is of another size.
std::optional<Eigen::Matrix3d> LensMatrix(const ValueView& view) {
  const size_t rows = view.ListSize();
  const bool nested = rows > 0 && view[0].value().kind == internal::Value::Kind::kList;
  if (nested && rows != 3 && rows != 4) return std::nullopt;
  if (nested) return view.Matrix(rows, view[0].ListSize() == 4 ? 4 : 3).topLeftCorner<3, 3>();
  if (rows != 4 && rows != 9 && rows != 16) return std::nullopt;
  const Eigen::VectorXd numbers = view.Vector(rows);
  if (rows == 4) return internal::CameraMatrix(numbers[0], numbers[1], numbers[2], numbers[3]);
  const Eigen::Index side = rows == 9 ? 3 : 4;
  return numbers.reshaped(side, side).transpose().topLeftCorner<3, 3>();
}

/// A frame's own camera matrix; none: it has none, or focal lengths of its own, or the file has them and this is no matrix.
std::optional<Eigen::Matrix3d> OwnMatrix(const ValueView& frame, bool file_has_focal) {
  if (frame.Has("fl_x") || frame.Has("camera_angle_x")) return std::nullopt;
  for (const char* key : {"K", "intrinsics", "intrinsic_matrix", "camera_matrix", "intrinsic"}) {
    if (!frame.Has(key) || frame[key].value().kind != internal::Value::Kind::kList) continue;
    const ValueView view = frame[key];
    const std::optional<Eigen::Matrix3d> read = LensMatrix(view);
    if (!read && file_has_focal) continue;
    if (!read) view.Fail("a 3x3 camera matrix was expected, or fx, fy, cx, cy");
    const Eigen::Matrix3d& matrix = *read;
    const bool upright = matrix(2, 0) == 0 && matrix(2, 1) == 0 && matrix(1, 0) == 0 && matrix(2, 2) == 1;
    if (!upright)
      view.Fail("is no camera matrix [fx 0 cx; 0 fy cy; 0 0 1]: if it stands transposed, write its rows as columns");
    if (matrix(0, 1) != 0) view.Fail("is a camera matrix with skew, which nerfstudio's lenses have not");
    return matrix;
  }
  return std::nullopt;
}

/// fl_x, fl_y, cx, cy with our pixel origin.
Eigen::Vector4d ReadFocalAndCentre(const FrameKeys& keys, const Eigen::Vector2d& size, const ValueView& frame) {
  Eigen::Vector4d k;
  const auto matrix = OwnMatrix(frame, keys.Has("fl_x") || keys.Has("camera_angle_x"));
  for (const char* other : {"fl_x", "fl_y", "cx", "cy"}) {
    if (matrix) static_cast<void>(keys.Has(other));  // the file's are those of other frames
  }
  if (matrix)
    return {(*matrix)(0, 0), (*matrix)(1, 1), (*matrix)(0, 2) - kCornerOriginShiftPx, (*matrix)(1, 2) - kCornerOriginShiftPx};
  const bool by_angle = !keys.Has("fl_x") && keys.Has("camera_angle_x");
  k[0] = by_angle ? size[0] / 2 / std::tan(keys["camera_angle_x"].Number() / 2) : keys["fl_x"].Number();
  const bool by_height = !keys.Has("fl_y") && !keys.Has("fl_x") && keys.Has("camera_angle_y");
  k[1] = by_height ? size[1] / 2 / std::tan(keys["camera_angle_y"].Number() / 2) : keys.Number("fl_y", k[0]);
  k[2] = keys.Number("cx", size[0] / 2) - kCornerOriginShiftPx;
  k[3] = keys.Number("cy", size[1] / 2) - kCornerOriginShiftPx;
  return k;
}

geometry::Camera ReadLens(const FrameKeys& keys, const ReadOptions& options, const ValueView& frame, const std::string& name) {
  const Eigen::Vector2d size = ReadSize(keys, options, frame);
  const Eigen::Vector4d k = ReadFocalAndCentre(keys, size, frame);
  const bool fisheye = keys.LensKindOf(options) == geometry::LensKind::kFisheye;
  const double k1 = keys.Number("k1", 0), k2 = keys.Number("k2", 0), k3 = keys.Number("k3", 0), k4 = keys.Number("k4", 0);
  const double p1 = keys.Number("p1", 0), p2 = keys.Number("p2", 0);
  Eigen::VectorXd distortion = (Eigen::VectorXd(5) << k1, k2, p1, p2, k3).finished();
  if (k3 == 0) distortion.conservativeResize(4);
  if (fisheye) {
    if (p1 != 0 || p2 != 0) frame.Fail("OPENCV_FISHEYE has no p1 and p2");
    distortion = Eigen::Vector4d(k1, k2, k3, k4);
  } else if (k4 != 0) {
    frame.Fail("a k4 beside OPENCV's k1, k2, p1, p2 is no lens model here; of a fisheye lens: option 'lens' fisheye");
  }
  for (const char* key : {"k5", "k6"}) {
    if (keys.Number(key, 0) != 0) keys[key].Fail("is no term of a lens that nerfstudio reads");
  }
  return internal::MakeCamera(name, size[0], size[1], internal::CameraMatrix(k[0], k[1], k[2], k[3]), distortion, fisheye,
                              frame.place());
}

/// world_from_cam with the camera's axes turned from OpenGL's to ours, and back: the turn is its own inverse.
geometry::Rigid3 TurnAxes(const geometry::Rigid3& world_from_cam) {
  geometry::Rigid3 half_turn;
  half_turn.rotation = Eigen::Quaterniond(0, 1, 0, 0);  // about x
  return world_from_cam * half_turn;
}

/// Names of files, times, and how other programs show or train on the scene.
constexpr std::initializer_list<const char*> kHarmlessInNerfstudio = {"maskpath",
                                                                      "depthfilepath",
                                                                      "depthpath",
                                                                      "colmapimid",
                                                                      "plyfilepath",
                                                                      "aabbscale",
                                                                      "aabb",
                                                                      "scale",
                                                                      "offset",
                                                                      "sharpness",
                                                                      "cameraanglex",
                                                                      "cameraangley",
                                                                      "timestamp",
                                                                      "time",
                                                                      "trainfilenames",
                                                                      "valfilenames",
                                                                      "testfilenames",
                                                                      "fromna",
                                                                      "enabledepthloading",
                                                                      "integerdepthscale",
                                                                      "nextralearnabledims",
                                                                      "whitetransparent",
                                                                      "blacktransparent",
                                                                      "orientationoverride",
                                                                      "rotation",
                                                                      "renderaabb",
                                                                      "up",
                                                                      "centroid",
                                                                      "k3",
                                                                      "k4",
                                                                      "k5",
                                                                      "k6",
                                                                      "p1",
                                                                      "p2",
                                                                      "frameindex",
                                                                      "frameid",
                                                                      "cameraid",
                                                                      "cam",
                                                                      "fps"};

/// The file's poses are those of the program before times `applied_scale`, and turned by `applied_transform`: the scale is
/// undone, so that the unit is that program's; the world stays as the file has it.
void UndoScale(const ValueView& root, ImportedRig* imported) {
  const double scale = root.Number("applied_scale", 1);
  if (!(scale > 0)) root["applied_scale"].Fail("must be positive");
  if (scale != 1) {
    for (geometry::RigCamera& camera : imported->rig.cameras) camera.cam_from_world.translation /= scale;
    imported->notes.push_back({"CAL-SCALED",
                               "the file says that its lengths were multiplied by applied_scale = " +
                                   internal::NumberText(scale) + "; they are divided by it",
                               ""});
  }
  if (!root.Has("applied_transform")) return;
  const Eigen::MatrixXd turn = root["applied_transform"].Matrix(root["applied_transform"].ListSize(), 4);
  if (turn.isIdentity(1e-12)) return;
  imported->notes.push_back({"CAL-TURNED",
                             "the file says that its world was turned by applied_transform; it is left as the file has it",
                             "calib align brings it into another frame"});
}

/// cameras.json of 3D Gaussian splatting: a list of images, each with its centre, world_from_cam as rows, and focal lengths.
ImportedRig ReadSplatCameras(const ValueView& root, const ReadOptions& options) {
  ImportedRig imported;
  imported.rig.gauge.kind = geometry::RigGauge::Kind::kImported;
  std::vector<internal::ImageCamera> images;
  for (size_t i = 0; i < root.ListSize(); ++i) {
    const ValueView view = root[i];
    const std::string& name = view["img_name"].Text();
    const double width = view["width"].Number(), height = view["height"].Number();
    geometry::Rigid3 world_from_cam;
    world_from_cam.rotation = internal::MakeRotation(view["rotation"].Matrix(3, 3), view["rotation"].place());
    world_from_cam.translation = view["position"].Vector(3) * options.metres_per_unit;
    geometry::RigCamera camera;
    const Eigen::Vector4d k(view["fx"].Number(), view["fy"].Number(), width / 2 - kCornerOriginShiftPx,
                            height / 2 - kCornerOriginShiftPx);
    camera.camera =
        internal::MakeModelCamera(internal::Stem(name), width, height, geometry::LensModel::kPinhole, k, view.place());
    camera.cam_from_world = Inverse(world_from_cam);
    images.push_back({name, internal::Stem(name), std::move(camera), view.place()});
  }
  if (images.empty()) root.Fail("there is no entry, hence no camera");
  internal::AddImageCameras(std::move(images), &imported);
  imported.notes.push_back(internal::UnitNote(options.metres_per_unit));
  imported.notes.push_back(
      {"CAL-CENTRED",
       "the file has no principal points: they are taken to be in the middle of the images, as 3D Gaussian "
       "splatting takes them",
       "the COLMAP model that was trained on has them"});
  geometry::UnusedKeys unused(root.place().path, options.metres_per_unit);
  for (size_t i = 0; i < root.ListSize(); ++i) internal::AddUnused(root[i], {"id"}, &unused);
  internal::AddUnusedNote(unused, &imported);
  return imported;
}

}  // namespace

ImportedRig ReadNerfstudio(const std::string& path, const ReadOptions& options) {
  const std::string file = std::filesystem::is_directory(path) ? path + "/transforms.json" : path;
  const internal::Value document = internal::ParseLiteral(file, ReadFile(file));
  const ValueView root(file, document);
  if (document.kind == internal::Value::Kind::kList) return ReadSplatCameras(root, options);
  const ValueView frames = root["frames"];
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("nerfstudio's world");
  std::vector<internal::ImageCamera> images;
  for (size_t i = 0; i < frames.ListSize(); ++i) {
    const ValueView frame = frames[i];
    const FrameKeys keys(frame, root);
    const std::string& file_path = frame["file_path"].Text();
    const std::string stem = internal::Stem(file_path);
    geometry::RigCamera camera;
    camera.camera = ReadLens(keys, options, frame, stem);
    geometry::Rigid3 world_from_cam = TurnAxes(frame["transform_matrix"].Transform());
    world_from_cam.translation *= options.metres_per_unit;
    camera.cam_from_world = Inverse(world_from_cam);
    images.push_back({file_path, stem, std::move(camera), frame.place()});
  }
  internal::AddImageCameras(std::move(images), &imported);
  if (imported.rig.cameras.empty()) frames.Fail("there is no frame, hence no camera");
  imported.notes.push_back(internal::UnitNote(options.metres_per_unit));
  UndoScale(root, &imported);
  geometry::UnusedKeys unused(file, options.metres_per_unit);
  internal::AddUnused(root, kHarmlessInNerfstudio, &unused);
  internal::AddUnusedNote(unused, &imported);
  return imported;
}

bool internal::NerfstudioCanCarry(const geometry::Camera& camera) {
  const auto lens = ToOpenCvLens(camera);
  return lens && lens->distortion.size() <= 4;
}

internal::Files internal::WriteNerfstudio(const geometry::Rig& rig, const std::string& path) {
  const std::string file = std::filesystem::path(path).extension() == ".json" ? path : path + "/transforms.json";
  const bool fisheye = OpenCvLensOf(rig.cameras[0].camera).fisheye;
  std::string text =
      std::string("{\n  \"camera_model\": ") + (fisheye ? "\"OPENCV_FISHEYE\"" : "\"OPENCV\"") + ",\n  \"frames\": [\n";
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    const geometry::Camera& camera = rig.cameras[i].camera;
    const OpenCvLens lens = OpenCvLensOf(camera);
    if (lens.fisheye != fisheye) {
      throw FormatError(file, camera.name,
                        "nerfstudio reads one kind of lens for all cameras; here are fisheye and perspective ones");
    }
    const Eigen::Matrix4d matrix = ToMatrix(TurnAxes(Inverse(rig.cameras[i].cam_from_world)));
    text += "    {\"file_path\": " + Quoted("images/" + camera.name + ".png") + ", \"w\": " + std::to_string(camera.width_px) +
            ", \"h\": " + std::to_string(camera.height_px) + ",\n     \"fl_x\": " + NumberText(camera.fx()) +
            ", \"fl_y\": " + NumberText(camera.fy()) + ", \"cx\": " + NumberText(camera.cx() + kCornerOriginShiftPx) +
            ", \"cy\": " + NumberText(camera.cy() + kCornerOriginShiftPx) + ",\n     ";
    const char* const keys[2][4] = {{"k1", "k2", "p1", "p2"}, {"k1", "k2", "k3", "k4"}};
    for (int k = 0; k < 4; ++k) {
      text += "\"" + std::string(keys[fisheye][k]) + "\": " + NumberText(k < lens.distortion.size() ? lens.distortion[k] : 0) +
              ", ";
    }
    text += "\n     \"transform_matrix\": [";
    for (int r = 0; r < 4; ++r) text += (r ? ", " : "") + ListText(matrix.row(r));
    text += i + 1 < rig.cameras.size() ? "]},\n" : "]}\n";
  }
  WriteFileAtomic(file, text + "  ]\n}\n");
  return {file};
}

}  // namespace mvstudio::calib
