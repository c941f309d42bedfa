#include <algorithm>
#include <filesystem>

#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"
#include "calib/formats/opencv_yaml.h"
#include "calib/formats/writers.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/some_of.h"
#include "core/units.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {
namespace {

using internal::Entries;
using internal::Entry;
using internal::FindEntry;
using internal::Place;

/// The items of `names:`, as they are written: 01 is not 1.
std::vector<std::string> ReadNames(const Entry& entry) {
  const auto fail = [&](const std::string& what) { throw FormatError(entry.place.path, entry.place.where, what); };
  std::vector<std::string> names;
  for (const internal::Value& item : entry.value.items) {
    if (item.text.empty()) fail("'- name' was expected in every line");
    names.push_back(item.text);
  }
  if (names.empty()) fail("there is no camera in this list");
  return names;
}

/// Whether the file's `names` hold the camera; a file without them may hold any.
bool Lists(const Entries& entries, const std::string& name) {
  const auto names = entries.find("names");
  if (names == entries.end()) return true;
  const std::vector<std::string> all = ReadNames(names->second);
  return std::find(all.begin(), all.end(), name) != all.end();
}

const Entry& Require(const Entries& entries, const std::string& key, const std::string& path) {
  const Entry* entry = FindEntry(entries, key);
  if (!entry) throw FormatError(path, key, "this entry is missing");
  return *entry;
}

Eigen::Vector2d ReadSize(const Entries& entries, const std::string& name, const std::string& path, const ReadOptions& options) {
  const Entry *width = FindEntry(entries, "W_" + name), *height = FindEntry(entries, "H_" + name);
  if (width && height) {
    return {internal::ReadNumber(*width), internal::ReadNumber(*height)};
  }
  if (options.width_px <= 0 || options.height_px <= 0) {
    throw UsageError(path + ": the file does not give the image size of camera " + internal::Printable(name) +
                     "; pass option 'size' WIDTHxHEIGHT");
  }
  return {options.width_px, options.height_px};
}

geometry::Rigid3 ReadPose(const Entries& entries, const std::string& name, const std::string& path) {
  const Entry *matrix = FindEntry(entries, "Rot_" + name), *vector = FindEntry(entries, "R_" + name);
  const Entry& translation = Require(entries, "T_" + name, path);
  geometry::Rigid3 pose;
  pose.rotation = internal::ReadRotation(matrix ? *matrix : vector ? *vector : Require(entries, "R_" + name, path));
  constexpr double kSame = DegToRad(0.1);
  if (matrix && vector && geometry::RotationAngle(pose.rotation, internal::ReadRotation(*vector)) > kSame)
    throw FormatError(path, "Rot_" + internal::Printable(name),
                      "is another rotation than R_" + internal::Printable(name) + ": one of them was changed; take it out");
  const Eigen::VectorXd t = internal::ReadVector(translation);
  if (t.size() != 3) throw FormatError(path, translation.place.where, "3 numbers were expected");
  pose.translation = t;
  return pose;
}

}  // namespace

ImportedRig ReadEasyMocap(const std::vector<std::string>& paths, const ReadOptions& options) {
  std::vector<std::string> files = paths;
  if (paths.size() == 1) {
    const std::filesystem::path given(paths[0]);
    const std::filesystem::path folder = std::filesystem::is_directory(given) ? given : given.parent_path();
    files = {(folder / "intri.yml").string(), (folder / "extri.yml").string()};
  }
  Entries intrinsics, extrinsics;
  if (files.size() != 2) throw UsageError("EasyMocap's calibration is two files, intri.yml and extri.yml, or their folder");
  internal::ReadEntries(files[0], false, &intrinsics);
  const bool placed = paths.size() == 2 || std::filesystem::exists(files[1]);
  if (placed) internal::ReadEntries(files[1], false, &extrinsics);
  const bool swapped =
      std::any_of(extrinsics.begin(), extrinsics.end(), [](const auto& entry) { return entry.first.compare(0, 2, "K_") == 0; });
  if (swapped) std::swap(intrinsics, extrinsics), std::swap(files[0], files[1]);
  ImportedRig imported;
  imported.rig.gauge.kind = geometry::RigGauge::Kind::kImported;
  std::vector<std::string> nowhere;
  for (const std::string& name : ReadNames(Require(intrinsics, "names", files[0]))) {
    const bool stands = extrinsics.count("T_" + name) || extrinsics.count("R_" + name) || extrinsics.count("Rot_" + name);
    if (placed && !stands && !Lists(extrinsics, name)) {
      nowhere.push_back(name);
      FindEntry(intrinsics, "K_" + name), FindEntry(intrinsics, "dist_" + name), FindEntry(intrinsics, "D_" + name);
      continue;
    }
    const Entry& matrix = Require(intrinsics, "K_" + name, files[0]);
    const Entry* distortion = FindEntry(intrinsics, "dist_" + name);
    if (!distortion) distortion = FindEntry(intrinsics, "D_" + name);
    const Eigen::Vector2d size = ReadSize(intrinsics, name, files[0], options);
    geometry::RigCamera camera =
        internal::MakeRigCamera(name, size, internal::ReadMatrix3(matrix), internal::ReadDistortion(distortion),
                                options.lens == geometry::LensKind::kFisheye, options, matrix.place, &imported.notes);
    geometry::Rigid3 pose = placed ? ReadPose(extrinsics, name, files[1]) : geometry::Rigid3();
    pose.translation *= options.metres_per_unit;
    camera.cam_from_world = camera.cam_from_world * pose;
    internal::AddCamera(std::move(camera), matrix.place, &imported.rig);
  }
  FindEntry(extrinsics, "names");
  if (imported.rig.cameras.empty()) throw FormatError(files[1], "names", "has none of the cameras of " + files[0]);
  if (!nowhere.empty())
    imported.notes.push_back({"CAL-IGNORED", "left out, because " + files[1] + " does not place them: " + SomeOf(nowhere),
                              "give their R_ and T_ to use them"});
  geometry::UnusedKeys unused(files[0], options.metres_per_unit);
  for (const Entries* entries : {&intrinsics, &extrinsics}) internal::AddUnusedEntries(*entries, {}, &unused);
  internal::AddUnusedNote(unused, &imported);
  if (!placed) internal::StateLensesOnly(&imported);
  return imported;
}

internal::Files internal::WriteEasyMocap(const geometry::Rig& rig, const std::string& path) {
  std::string names = "%YAML:1.0\n---\nnames:\n";
  for (const geometry::RigCamera& camera : rig.cameras) {
    const std::string& name = camera.camera.name;
    if (name.find_first_of(" \t:'\"\\#") != std::string::npos) {
      throw UsageError("the camera name '" + Printable(name) +
                       "' cannot be part of a key of EasyMocap's; use option 'rename' OLD=NEW");
    }
    names += "  - " + Quoted(FileName(name)) + "\n";
  }
  std::string intrinsics = names, extrinsics = names;
  for (const geometry::RigCamera& camera : rig.cameras) {
    const std::string& name = camera.camera.name;
    const OpenCvLens lens = OpenCvLensOf(camera.camera);
    Eigen::RowVectorXd distortion = Eigen::RowVectorXd::Zero(std::max<Eigen::Index>(lens.distortion.size(), 5));
    distortion.head(lens.distortion.size()) = lens.distortion.transpose();
    intrinsics += MatrixEntry("K_" + name, camera.camera.K()) + MatrixEntry("dist_" + name, distortion);
    intrinsics += "H_" + name + ": " + std::to_string(camera.camera.height_px) + "\nW_" + name + ": " +
                  std::to_string(camera.camera.width_px) + "\n";
    extrinsics += MatrixEntry("R_" + name, geometry::RotationLog(camera.cam_from_world.rotation)) +
                  MatrixEntry("Rot_" + name, camera.cam_from_world.rotation.toRotationMatrix()) +
                  MatrixEntry("T_" + name, camera.cam_from_world.translation);
  }
  WriteFileAtomic(path + "/intri.yml", intrinsics);
  WriteFileAtomic(path + "/extri.yml", extrinsics);
  return {path + "/intri.yml", path + "/extri.yml"};
}

}  // namespace mvstudio::calib
