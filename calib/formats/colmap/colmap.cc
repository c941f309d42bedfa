#include <algorithm>
#include <cmath>
#include <filesystem>

#include "calib/board/pixel_origin.h"
#include "calib/formats/colmap/colmap_files.h"
#include "calib/formats/format_camera.h"
#include "calib/formats/formats.h"
#include "core/check.h"
#include "core/error.h"
#include "core/units.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {
namespace internal {
namespace {

using geometry::LensModel;

constexpr ColmapModel kModels[] = {{0, "SIMPLE_PINHOLE", 3},
                                   {1, "PINHOLE", 4},
                                   {2, "SIMPLE_RADIAL", 4},
                                   {3, "RADIAL", 5},
                                   {4, "OPENCV", 8},
                                   {5, "OPENCV_FISHEYE", 8},
                                   {6, "FULL_OPENCV", 12},
                                   {7, "FOV", 5},
                                   {8, "SIMPLE_RADIAL_FISHEYE", 4},
                                   {9, "RADIAL_FISHEYE", 5},
                                   {10, "THIN_PRISM_FISHEYE", 12},
                                   {11, "RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                   {12, "SIMPLE_DIVISION", 4},
                                   {13, "DIVISION", 5},
                                   {14, "SIMPLE_FISHEYE", 3},
                                   {15, "FISHEYE", 4},
                                   {16, "EUCM", 6},
                                   {17, "EQUIRECTANGULAR", 2}};

/// One focal length, then the centre.
bool HasOneFocal(const ColmapModel& model) {
  constexpr int kIds[] = {0, 2, 3, 8, 9, 14};
  return std::find(std::begin(kIds), std::end(kIds), model.id) != std::end(kIds);
}

[[noreturn]] void FailWithLens(const ColmapCamera& camera, const std::string& what = "") {
  throw FormatError(camera.place.path, camera.place.where,
                    "the lens " + std::string(camera.model->name) + what + " is no lens model here; use " +
                        (camera.model->id == 17 ? "images of PINHOLE" : "OPENCV_FISHEYE") + " in COLMAP");
}

/// Distortion of a file's camera as ours has it.
Eigen::VectorXd OwnDistortion(const ColmapCamera& camera, LensModel* lens) {
  const size_t start = std::min<size_t>(HasOneFocal(*camera.model) ? 3 : 4, camera.params.size());
  const Eigen::VectorXd k =
      Eigen::Map<const Eigen::VectorXd>(camera.params.data() + start, static_cast<Eigen::Index>(camera.params.size() - start));
  switch (camera.model->id) {
    case 2:
      *lens = LensModel::kBrown1;
      return k;
    case 3:
      *lens = LensModel::kBrown2;
      return k;
    case 4:
      *lens = LensModel::kBrown4;
      return k;
    case 6:
      *lens = LensModel::kRational8;
      return k;
    case 5:
    case 8:
    case 9:
    case 10:
    case 14:
    case 15: {
      *lens = LensModel::kKannalaBrandt4;
      Eigen::VectorXd own = Eigen::VectorXd::Zero(4);
      if (camera.model->id != 10) {
        own.head(k.size()) = k;
      } else if (k[2] == 0 && k[3] == 0 && k[6] == 0 && k[7] == 0) {
        own << k[0], k[1], k[4], k[5];
      } else {
        FailWithLens(camera, " with p1, p2, sx1 or sy1");
      }
      return own;
    }
    case 11:
      if (!k.tail(8).isZero(0)) FailWithLens(camera, " with more than k0 to k3");
      *lens = LensModel::kKannalaBrandt4;
      return k.head(4);
    case 16:
      *lens = LensModel::kEucm;
      return k;
    case 7:
    case 12:
    case 13:
    case 17:
      FailWithLens(camera);
    default:
      *lens = LensModel::kPinhole;
      return k;
  }
}

geometry::Camera ToCamera(const ColmapCamera& file, const std::string& name) {
  const bool one_focal = HasOneFocal(*file.model);
  LensModel lens = LensModel::kPinhole;
  const Eigen::VectorXd distortion = OwnDistortion(file, &lens);
  const double *p = file.params.data(), *centre = p + (one_focal ? 1 : 2);
  if (distortion.isZero(0) && lens != LensModel::kKannalaBrandt4) lens = LensModel::kPinhole;
  const Eigen::Index count = geometry::NumDistortionParams(lens);
  Eigen::VectorXd params(4 + count);
  params << p[0], one_focal ? p[0] : p[1], centre[0] - kCornerOriginShiftPx, centre[1] - kCornerOriginShiftPx,
      distortion.head(count);
  return MakeModelCamera(name, file.width_px, file.height_px, lens, params, file.place);
}

/// Null model when COLMAP has no such lens.
ColmapCamera FromCamera(const geometry::Camera& camera) {
  ColmapCamera file;
  const auto lens = ToOpenCvLens(camera);
  if (!lens || lens->distortion.size() > 8) return file;
  const Eigen::Index count = lens->distortion.size();
  file.model = FindColmapModel(lens->fisheye ? 5 : count == 0 ? 1 : count == 4 ? 4 : 6);
  file.width_px = camera.width_px, file.height_px = camera.height_px;
  file.params = {camera.fx(), camera.fy(), camera.cx() + kCornerOriginShiftPx, camera.cy() + kCornerOriginShiftPx};
  for (Eigen::Index i = 0; i < count; ++i) file.params.push_back(lens->distortion[i]);
  file.params.resize(static_cast<size_t>(file.model->num_params), 0);
  return file;
}

/// A camera and an image each, and one rig of all that took them at once.
ColmapFiles ModelOf(const geometry::Rig& rig, const std::vector<std::string>& images) {
  ColmapFiles model;
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    const geometry::RigCamera& camera = rig.cameras[i];
    if (images[i].find_first_of(" \t\n\r") != std::string::npos) {
      throw UsageError("the camera name '" + Printable(camera.camera.name) +
                       "' has a space in it, which COLMAP cannot read; use option 'rename' OLD=NEW");
    }
    const uint32_t id = static_cast<uint32_t>(i + 1);
    model.cameras[id] = FromCamera(camera.camera);
    if (!model.cameras[id].model) throw UsageError("COLMAP has no lens like that of camera " + Printable(camera.camera.name));
    model.images.push_back({id, camera.cam_from_world.rotation, camera.cam_from_world.translation, id, images[i], {}});
    if (i == 0) model.rigs.push_back({1, {}}), model.frames.push_back({1, 1, camera.cam_from_world, {}, {}});
    model.frames[0].images.push_back(id);
    model.rigs[0].cameras.push_back({id, camera.cam_from_world * Inverse(rig.cameras[0].cam_from_world)});
  }
  return model;
}

std::string WithoutImageExtension(const std::string& name) {
  for (const std::string known : {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".PNG", ".JPG", ".JPEG"}) {
    const size_t rest = name.size() - std::min(name.size(), known.size());
    if (rest > 0 && name.compare(rest, known.size(), known) == 0) return name.substr(0, rest);
  }
  return name;
}

}  // namespace

const ColmapModel* FindColmapModel(int id) {
  for (const ColmapModel& model : kModels) {
    if (model.id == id) return &model;
  }
  return nullptr;
}

const ColmapModel* FindColmapModel(const std::string& name) {
  for (const ColmapModel& model : kModels) {
    if (model.name == name) return &model;
  }
  return nullptr;
}

Eigen::Quaterniond ColmapRotation(double w, double x, double y, double z, const Place& place) {
  const Eigen::Quaterniond rotation(w, x, y, z);
  if (!(std::abs(rotation.norm() - 1) < 1e-3))
    throw FormatError(place.path, place.where, "the quaternion is not of unit length");
  return rotation.normalized();
}

bool ColmapCanCarry(const geometry::Camera& camera) { return FromCamera(camera).model != nullptr; }

Files WriteColmap(const geometry::Rig& rig, const std::string& path, bool text) {
  std::vector<std::string> images;
  for (const geometry::RigCamera& camera : rig.cameras) images.push_back(camera.camera.name + ".png");
  const ColmapFiles model = ModelOf(rig, images);
  return text ? WriteColmapText(model, path) : WriteColmapBinary(model, path);
}

}  // namespace internal

std::vector<std::string> WriteColmapModel(const geometry::Rig& rig, const std::vector<std::string>& images,
                                          const std::vector<ColmapModelPoint>& points, const std::string& folder) {
  MVS_CHECK(images.size() == rig.cameras.size(), images.size() << " images of " << rig.cameras.size() << " cameras");
  const Eigen::Vector2d shift = Eigen::Vector2d::Constant(kCornerOriginShiftPx);
  internal::ColmapFiles model = internal::ModelOf(rig, images);
  // As COLMAP's own database of such images has them, with which its programs compare: a rig a camera, a frame an image.
  model.rigs.clear(), model.frames.clear();
  for (const internal::ColmapImage& image : model.images) {
    model.rigs.push_back({image.camera_id, {{image.camera_id, geometry::Rigid3()}}});
    model.frames.push_back({image.id, image.camera_id, {image.rotation, image.translation}, {image.id}, {}});
  }
  for (const ColmapModelPoint& point : points) {
    const uint64_t id = model.points.size() + 1;
    internal::ColmapPoint out{point.x_in_world, point.rgb, point.error_px, {}};
    for (const ColmapModelPoint::Seen& seen : point.track) {
      std::vector<internal::ColmapImage::Feature>& features = model.images.at(seen.camera_idx).features;
      out.track.emplace_back(static_cast<uint32_t>(seen.camera_idx + 1), static_cast<uint32_t>(features.size()));
      features.push_back({seen.px + shift, id});
    }
    model.points.push_back(std::move(out));
  }
  std::vector<std::string> files = internal::WriteColmapBinary(model, folder);
  for (const std::string& file : internal::WriteColmapText(model, folder)) files.push_back(file);
  return files;
}

namespace {

const internal::ColmapSensor* SensorOf(const internal::ColmapRig& rig, uint32_t camera_id) {
  for (const internal::ColmapSensor& sensor : rig.cameras) {
    if (sensor.camera_id == camera_id) return &sensor;
  }
  return nullptr;
}

/// The one rig of two cameras or more that took all images and whose cameras' places in it are known; else null.
const internal::ColmapRig* RigOfAll(const internal::ColmapFiles& model) {
  const internal::ColmapRig* of_all = nullptr;
  for (const internal::ColmapRig& rig : model.rigs) {
    if (rig.cameras.size() < 2) continue;
    if (of_all) return nullptr;
    of_all = &rig;
  }
  if (!of_all) return nullptr;
  for (const internal::ColmapImage& image : model.images) {
    const internal::ColmapSensor* sensor = SensorOf(*of_all, image.camera_id);
    if (!sensor || !sensor->sensor_from_rig) return nullptr;
  }
  return of_all;
}

/// Throws FormatError where an image does not stand where its rig stood at that moment: COLMAP 3.12 believes the rig, older
/// programs the image.
void CheckFrame(const internal::ColmapFrame& frame, const internal::ColmapRig& rig,
                const std::map<uint64_t, const internal::ColmapImage*>& images, double extent, internal::ColmapFiles* model) {
  constexpr double kTurn = DegToRad(0.1), kShare = 1e-3;
  for (const uint64_t id : frame.images) {
    const auto found = images.find(id);
    if (found == images.end()) {
      model->conflicts.push_back(frame.place.path + ": " + frame.place.where + " names image " + std::to_string(id) +
                                 ", which the model does not hold");
      continue;
    }
    const internal::ColmapImage& image = *found->second;
    const internal::ColmapSensor* sensor = SensorOf(rig, image.camera_id);
    if (!sensor || !sensor->sensor_from_rig) continue;
    const geometry::Rigid3 by_rig = *sensor->sensor_from_rig * frame.rig_from_world, own{image.rotation, image.translation};
    const double apart = (Inverse(by_rig).translation - Inverse(own).translation).norm();
    if (apart <= kShare * extent && geometry::RotationAngle(by_rig.rotation, own.rotation) <= kTurn) continue;
    throw FormatError(image.place.path, image.place.where,
                      "image " + internal::Printable(image.name) + " stands elsewhere than rigs and frames place it (" +
                          frame.place.path + ": " + frame.place.where +
                          "): one of the files was changed by itself; let COLMAP write the model again, or take rigs and "
                          "frames out of the folder if the images are right");
  }
}

/// What frames state, held against rigs and images.
void CheckFrames(internal::ColmapFiles* model) {
  if (model->frames.empty()) return;
  std::map<uint64_t, const internal::ColmapImage*> images;
  double extent = 1e-9;
  for (const internal::ColmapImage& image : model->images) {
    images[image.id] = &image;
    extent = std::max(extent, image.translation.norm());
  }
  size_t named = 0;
  for (const internal::ColmapFrame& frame : model->frames) {
    const auto is = [&](const internal::ColmapRig& rig) { return rig.id == frame.rig_id; };
    const auto rig = std::find_if(model->rigs.begin(), model->rigs.end(), is);
    if (rig == model->rigs.end())
      throw FormatError(frame.place.path, frame.place.where, "there is no rig " + std::to_string(frame.rig_id));
    CheckFrame(frame, *rig, images, extent, model);
    named += frame.images.size();
  }
  if (named < images.size())
    model->conflicts.push_back(model->frames[0].place.path + " names " + std::to_string(named) + " images, the model holds " +
                               std::to_string(images.size()));
}

/// The cameras of a rig, as they stood in the first image. `images`: as they stand one by one.
void AddRigCameras(const internal::ColmapFiles& model, const internal::ColmapRig& rig, const ReadOptions& options,
                   const std::vector<internal::ImageCamera>& images, ImportedRig* imported) {
  std::vector<internal::ImageCamera> cameras;
  const geometry::Rigid3 rig_from_world = Inverse(*SensorOf(rig, model.images[0].camera_id)->sensor_from_rig) *
                                          geometry::Rigid3{model.images[0].rotation, model.images[0].translation};
  for (const internal::ColmapSensor& sensor : rig.cameras) {
    for (size_t i = 0; i < images.size(); ++i) {
      if (model.images[i].camera_id != sensor.camera_id) continue;
      cameras.push_back(images[i]);
      cameras.back().camera.cam_from_world = *sensor.sensor_from_rig * rig_from_world;
      cameras.back().camera.cam_from_world.translation *= options.metres_per_unit;
      break;
    }
  }
  internal::AddImageCameras(std::move(cameras), imported);
  if (images.size() == imported->rig.cameras.size()) return;
  imported->notes.push_back({"CAL-MERGED",
                             std::to_string(images.size()) + " images are of " + std::to_string(imported->rig.cameras.size()) +
                                 " cameras of one rig (rigs.txt or rigs.bin): one camera each, as they stood for " +
                                 internal::Printable(model.images[0].name),
                             "the world is the model's; a rig that moves is at rest in it"});
}

}  // namespace

ImportedRig ReadColmap(const std::string& path, const ReadOptions& options) {
  namespace fs = std::filesystem;
  const std::string folder = fs::is_directory(path) ? path : fs::path(path).parent_path().string();
  const bool named_text = fs::path(path).extension() == ".txt";
  const bool binary = !named_text && fs::exists(fs::path(folder) / "cameras.bin");
  internal::ColmapFiles model = binary ? internal::ReadColmapBinary(folder) : internal::ReadColmapText(folder);
  if (model.images.empty())
    throw FormatError(folder, "images", "there is no image in this model, hence no camera with a place");
  CheckFrames(&model);
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("COLMAP's world");
  std::vector<internal::ImageCamera> images;
  for (const internal::ColmapImage& image : model.images) {
    const auto found = model.cameras.find(image.camera_id);
    if (found == model.cameras.end()) {
      throw FormatError(image.place.path, image.place.where, "there is no camera " + std::to_string(image.camera_id));
    }
    const std::string name = internal::WithoutImageExtension(image.name);
    geometry::RigCamera camera;
    camera.camera = internal::ToCamera(found->second, name);
    camera.cam_from_world = {image.rotation, image.translation * options.metres_per_unit};
    images.push_back({image.name, name, std::move(camera), image.place});
  }
  if (const auto* rig = RigOfAll(model))
    AddRigCameras(model, *rig, options, images, &imported);
  else
    internal::AddImageCameras(std::move(images), &imported);
  for (const std::string& conflict : model.conflicts)
    imported.notes.push_back({"CAL-COUNT", conflict, "the file was cut short or edited; cameras may be missing"});
  imported.notes.push_back(internal::UnitNote(options.metres_per_unit));
  return imported;
}

}  // namespace mvstudio::calib
