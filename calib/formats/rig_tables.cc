#include "calib/formats/rig_tables.h"

#include "calib/formats/document.h"
#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/some_of.h"
#include "geometry/rig/file_keys.h"

namespace mvstudio::calib::internal {
namespace {

/// The entries of a camera's table, by plain keys.
Entries EntriesOf(const Entry& table) {
  Entries entries;
  for (const auto& [key, value] : table.value.entries)
    entries.insert({geometry::PlainKey(key), {value, {table.place.path, table.place.where + "." + Printable(key)}}});
  return entries;
}

const Entry& NeededIn(const Entries& entries, const Entry& table, const std::string& key, const char* shown) {
  if (const Entry* const entry = FindEntry(entries, key)) return *entry;
  throw FormatError(table.place.path, table.place.where, "the key '" + std::string(shown) + "' is missing");
}

bool IsCameraOfMcCalib(const std::string& key, const Entry& entry) {
  return key.rfind("camera", 0) == 0 && entry.value.kind == Value::Kind::kTable && EntriesOf(entry).count("cameraposematrix");
}

geometry::RigCamera McCalibCamera(const Entry& table, const ReadOptions& options, std::vector<Notice>* notes) {
  const Entries own = EntriesOf(table);
  const double type = ReadNumber(NeededIn(own, table, "distortiontype", "distortion_type"));
  if (type != 0 && type != 1)
    throw FormatError(table.place.path, table.place.where + ".distortion_type",
                      NumberText(type) + " is not known here: 0 (Brown) and 1 (Kannala, fisheye) are");
  const Eigen::Vector2d size(ReadNumber(NeededIn(own, table, "imgwidth", "img_width")),
                             ReadNumber(NeededIn(own, table, "imgheight", "img_height")));
  const Entry& terms = NeededIn(own, table, "distortionvector", "distortion_vector");
  const Entry& lens = NeededIn(own, table, "cameramatrix", "camera_matrix");
  geometry::RigCamera camera =
      MakeRigCamera(table.place.where, size, ReadMatrix3(lens), ReadDistortion(&terms), type == 1, options, lens.place, notes);
  const Entry& pose = NeededIn(own, table, "cameraposematrix", "camera_pose_matrix");
  const Eigen::MatrixXd matrix = ReadMatrix(pose);
  if (matrix.rows() != 4 || matrix.cols() != 4)
    throw FormatError(pose.place.path, pose.place.where, "a 4x4 matrix was expected");
  const geometry::Rigid3 world_from_cam{MakeRotation(matrix.topLeftCorner<3, 3>(), pose.place),
                                        matrix.topRightCorner<3, 1>() * options.metres_per_unit};
  camera.cam_from_world = camera.cam_from_world * Inverse(world_from_cam);
  return camera;
}

/// Number of coefficients of multical's dist, a list or a list of one row.
Eigen::VectorXd MulticalTerms(const ValueView& dist) {
  const bool rows = dist.ListSize() == 1 && dist.value().items[0].kind == Value::Kind::kList;
  return rows ? dist[0].Vector() : dist.Vector();
}

/// fx, fy, cx, cy and skew of MATLAB's parameters, pixels from 0.
Eigen::Matrix3d MatlabMatrix(const ValueView& parameters) {
  Eigen::Matrix3d k;
  if (parameters.Has("K")) {
    k = parameters["K"].Matrix(3, 3);
  } else if (parameters.Has("IntrinsicMatrix")) {
    k = parameters["IntrinsicMatrix"].Matrix(3, 3).transpose();
  } else {
    const Eigen::VectorXd focal = parameters["FocalLength"].Vector(2), centre = parameters["PrincipalPoint"].Vector(2);
    k = CameraMatrix(focal[0], focal[1], centre[0], centre[1]);
    k(0, 1) = parameters.Number("Skew", 0);
  }
  k(0, 2) -= 1, k(1, 2) -= 1;
  return k;
}

geometry::RigCamera MatlabCamera(const ValueView& parameters, const std::string& name, const ReadOptions& options,
                                 std::vector<Notice>* notes) {
  const Eigen::VectorXd radial = parameters["RadialDistortion"].Vector(),
                        decentring = parameters["TangentialDistortion"].Vector(2);
  if (radial.size() != 2 && radial.size() != 3) parameters["RadialDistortion"].Fail("2 or 3 numbers were expected");
  Eigen::VectorXd terms(radial.size() + 2);
  terms << radial.head<2>(), decentring, radial.tail(radial.size() - 2);
  Eigen::Vector2d size(options.width_px, options.height_px);
  if (parameters.Has("ImageSize") && parameters["ImageSize"].ListSize() > 0) size = parameters["ImageSize"].Vector(2).reverse();
  if (size.minCoeff() <= 0)
    throw UsageError(parameters.place().path + ": the file does not give the image size; pass option 'size' WIDTHxHEIGHT");
  geometry::UnusedKeys units(parameters.place().path, options.metres_per_unit);
  if (parameters.Has("WorldUnits")) {
    const ValueView unit = parameters["WorldUnits"];
    units.Add(unit.where(), "units", unit.Text());
  }
  return MakeRigCamera(name, size, MatlabMatrix(parameters), terms, false, options, parameters.place(), notes);
}

/// Camera 2 from camera 1: MATLAB's older keys multiply rows from the right.
geometry::Rigid3 MatlabPose(const ValueView& root, const ReadOptions& options) {
  geometry::Rigid3 pose;
  if (root.Has("PoseCamera2") && !root.Has("RotationOfCamera2")) {
    const ValueView pose2 = root["PoseCamera2"];
    pose.rotation = MakeRotation(pose2["R"].Matrix(3, 3), pose2.place());
    pose.translation = pose2["Translation"].Vector(3);
  } else {
    const ValueView rotation = root["RotationOfCamera2"];
    pose.rotation = MakeRotation(rotation.Matrix(3, 3).transpose(), rotation.place());
    pose.translation = root["TranslationOfCamera2"].Vector(3);
  }
  pose.translation *= options.metres_per_unit;
  return pose;
}

bool HasText(std::string_view text, const char* piece) { return text.find(piece) != std::string_view::npos; }

constexpr double kMetresPerMm = 1e-3;

Notice MillimetresNote(const char* dataset) {
  return {"CAL-UNIT", std::string("translations are taken as millimetres, as ") + dataset + " has them", ""};
}

/// The only table of several that are rigs of their own: subjects, captures.
ValueView OnlyRig(const ValueView& rigs, const char* what) {
  const auto& entries = rigs.value().entries;
  if (entries.empty()) rigs.Fail(std::string("holds no ") + what);
  std::vector<std::string> names;
  for (const auto& [name, value] : entries) names.push_back(Printable(name));
  if (names.size() > 1)
    rigs.Fail("holds " + std::to_string(names.size()) + " " + what + "s (" + SomeOf(names) +
              "), each with a rig of its own: keep the one of your footage in the file");
  return rigs[entries[0].first];
}

Eigen::Vector2d SizeGiven(const std::string& path, const ReadOptions& options) {
  if (options.width_px <= 0 || options.height_px <= 0)
    throw UsageError(path + ": the file does not give the image size; pass option 'size' WIDTHxHEIGHT");
  return {options.width_px, options.height_px};
}

/// Three numbers, in a list or a column.
Eigen::Vector3d Column3(const ValueView& view) {
  const bool rows = view.ListSize() == 3 && view[0].value().kind == Value::Kind::kList;
  return rows ? Eigen::Vector3d(view.Matrix(3, 1)) : Eigen::Vector3d(view.Vector(3));
}

}  // namespace

bool IsMcCalib(const Entries& entries) {
  for (const auto& [key, entry] : entries) {
    if (IsCameraOfMcCalib(key, entry)) return true;
  }
  return false;
}

ImportedRig ReadMcCalib(const std::string& path, const Entries& entries, const ReadOptions& options) {
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("MC-Calib's reference camera");
  std::string group;
  for (const auto& [key, entry] : entries) {
    if (!IsCameraOfMcCalib(key, entry)) continue;
    geometry::RigCamera camera = McCalibCamera(entry, options, &imported.notes);
    const Entries own = EntriesOf(entry);
    const Entry* const stated = FindEntry(own, "cameragroup");
    const std::string its = stated ? TextOf(stated->value) : "";
    if (!imported.rig.cameras.empty() && its != group)
      throw FormatError(path, entry.place.where + ".camera_group",
                        "is " + Printable(its) + ", and " + imported.rig.cameras[0].camera.name + " is of group " +
                            Printable(group) + ": nothing places groups against each other; give a file for each group");
    group = its;
    AddCamera(std::move(camera), entry.place, &imported.rig);
  }
  imported.notes.push_back(UnitNote(options.metres_per_unit));
  return imported;
}

bool IsMultical(std::string_view json) { return HasText(json, "\"camera_poses\"") && HasText(json, "\"cameras\""); }

ImportedRig ReadMultical(const std::string& path, const ReadOptions& options) {
  const Value document = ParseLiteral(path, ReadFile(path));
  const ValueView root(path, document), cameras = root["cameras"], poses = root["camera_poses"];
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("multical's rig");
  for (const auto& [name, value] : cameras.value().entries) {
    const ValueView view = cameras[name];
    geometry::LensWords words;
    if (view["model"].Text() == "fisheye") words.Add(path, view.where() + ".model", "lens", "fisheye");
    const bool fisheye = LensKindOf(words, options, view.place()) == geometry::LensKind::kFisheye;
    geometry::RigCamera camera = MakeRigCamera(name, view["image_size"].Vector(2), view["K"].Matrix(3, 3),
                                               MulticalTerms(view["dist"]), fisheye, options, view.place(), &imported.notes);
    std::string key = name;
    for (const auto& [other, pose] : poses.value().entries) {
      if (other.rfind(name + "_to_", 0) == 0) key = other;
    }
    const ValueView pose = poses[key];
    camera.cam_from_world = camera.cam_from_world * geometry::Rigid3{MakeRotation(pose["R"].Matrix(3, 3), pose.place()),
                                                                     pose["T"].Vector(3) * options.metres_per_unit};
    AddCamera(std::move(camera), view.place(), &imported.rig);
  }
  if (imported.rig.cameras.empty()) cameras.Fail("there is no camera in it");
  imported.notes.push_back(UnitNote(options.metres_per_unit));
  return imported;
}

bool IsMatlab(std::string_view json) {
  return HasText(json, "\"RadialDistortion\"") && HasText(json, "\"TangentialDistortion\"");
}

ImportedRig ReadMatlab(const std::string& path, const ReadOptions& options) {
  const Value document = ParseLiteral(path, ReadFile(path));
  const ValueView root(path, document);
  ImportedRig imported;
  const bool stereo = root.Has("CameraParameters1");
  imported.rig.gauge = geometry::RigGauge::OfCamera(stereo ? "camera1" : "camera");
  if (!stereo) {
    AddCamera(MatlabCamera(root, "camera", options, &imported.notes), root.place(), &imported.rig);
    return imported;
  }
  geometry::RigCamera first = MatlabCamera(root["CameraParameters1"], "camera1", options, &imported.notes);
  geometry::RigCamera second = MatlabCamera(root["CameraParameters2"], "camera2", options, &imported.notes);
  second.cam_from_world = second.cam_from_world * MatlabPose(root, options);
  AddCamera(std::move(first), root.place(), &imported.rig);
  AddCamera(std::move(second), root.place(), &imported.rig);
  imported.notes.push_back(UnitNote(options.metres_per_unit));
  return imported;
}

bool IsHuman36m(std::string_view json) { return HasText(json, "\"calibration_matrix\"") && HasText(json, "\"extrinsics\""); }

ImportedRig ReadHuman36m(const std::string& path, const ReadOptions& options) {
  const Value document = ParseLiteral(path, ReadFile(path));
  const ValueView root(path, document), lenses = root["intrinsics"], poses = OnlyRig(root["extrinsics"], "subject");
  const Eigen::Vector2d size = SizeGiven(path, options);
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("Human3.6M's world");
  for (const auto& [name, value] : poses.value().entries) {
    const ValueView pose = poses[name], lens = lenses[name];
    geometry::RigCamera camera = MakeRigCamera(name, size, lens["calibration_matrix"].Matrix(3, 3),
                                               lens["distortion"].Vector(5), false, options, lens.place(), &imported.notes);
    camera.cam_from_world = camera.cam_from_world * geometry::Rigid3{MakeRotation(pose["R"].Matrix(3, 3), pose.place()),
                                                                     Column3(pose["t"]) * kMetresPerMm};
    AddCamera(std::move(camera), pose.place(), &imported.rig);
  }
  imported.notes.push_back(MillimetresNote("Human3.6M"));
  return imported;
}

bool IsInterHand(std::string_view json) {
  return HasText(json, "\"campos\"") && HasText(json, "\"camrot\"") && HasText(json, "\"princpt\"");
}

ImportedRig ReadInterHand(const std::string& path, const ReadOptions& options) {
  const Value document = ParseLiteral(path, ReadFile(path));
  const ValueView root(path, document), capture = root.Has("campos") ? root : OnlyRig(root, "capture");
  const Eigen::Vector2d size = SizeGiven(path, options);
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("InterHand2.6M's world");
  for (const auto& [name, value] : capture["campos"].value().entries) {
    const ValueView turn = capture["camrot"][name];
    const Eigen::VectorXd focal = capture["focal"][name].Vector(2), centre = capture["princpt"][name].Vector(2);
    geometry::RigCamera camera = MakeRigCamera("cam" + name, size, CameraMatrix(focal[0], focal[1], centre[0], centre[1]),
                                               Eigen::VectorXd(), false, options, turn.place(), &imported.notes);
    const Eigen::Quaterniond rotation = MakeRotation(turn.Matrix(3, 3), turn.place());
    camera.cam_from_world = geometry::Rigid3{rotation, -(rotation * Column3(capture["campos"][name])) * kMetresPerMm};
    AddCamera(std::move(camera), turn.place(), &imported.rig);
  }
  if (imported.rig.cameras.empty()) capture.Fail("there is no camera in it");
  imported.notes.push_back(MillimetresNote("InterHand2.6M"));
  return imported;
}

}  // namespace mvstudio::calib::internal
