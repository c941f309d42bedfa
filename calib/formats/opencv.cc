#include <algorithm>
#include <filesystem>
#include <optional>

#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"
#include "calib/formats/opencv_keys.h"
#include "calib/formats/opencv_yaml.h"
#include "calib/formats/photogrammetry.h"
#include "calib/formats/rig_tables.h"
#include "calib/formats/slam.h"
#include "calib/formats/writers.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/some_of.h"

namespace mvstudio::calib {
namespace {

using internal::Entries;
using internal::Entry;
using internal::FindEntry;
using internal::FindFirst;
using internal::FindPose;
using internal::IsJarvis;
using internal::IsOpenPose;
using internal::kDistortionKeys;
using internal::kRotationKeys;
using internal::kTranslationKeys;
using internal::ReadPose;
using internal::RefuseOtherPoses;
using internal::StereoKeys;
using internal::StereoKeysOf;

constexpr std::initializer_list<const char*> kMatrixKeys = {"cameramatrix", "k", "mtx", "intrinsicmatrix", "matrix"};
/// The same in a camera's own table, where `intrinsics` may be the matrix itself.
constexpr std::initializer_list<const char*> kOwnMatrixKeys = {"cameramatrix",    "k",      "mtx",
                                                               "intrinsicmatrix", "matrix", "intrinsics"};
Eigen::Vector2d ReadSize(const Entries& entries, const std::string& path, const ReadOptions& options) {
  const Entry* width = FindFirst(entries, {"imagewidth", "width"});
  const Entry* height = FindFirst(entries, {"imageheight", "height"});
  if (width && height) {
    return {internal::ReadNumber(*width), internal::ReadNumber(*height)};
  }
  const Entry* both = FindFirst(entries, {"resolution", "imagesize", "imgsize", "dim", "size", "imagedimension"});
  if (both && both->value.kind == internal::Value::Kind::kList && both->value.items.size() == 2)
    return {both->value.items[0].number, both->value.items[1].number};
  if (both && both->value.kind == internal::Value::Kind::kTable) {
    const Eigen::VectorXd size = internal::ReadVector(*both);
    if (size.size() == 2) return size;
  }
  if (options.width_px <= 0 || options.height_px <= 0) {
    throw UsageError(path + ": the file does not give the image size; pass option 'size' WIDTHxHEIGHT");
  }
  return {options.width_px, options.height_px};
}

/// OpenCV's functions for fisheye lenses write four coefficients in a column, the others a row or five; a column whose last two
/// are no lens's decentring is not taken for either without a word.
void CheckKindIsSaid(const Entry& distortion, const Eigen::VectorXd& terms) {
  constexpr double kMaxMeasuredDecentring = 0.01;
  const Eigen::MatrixXd matrix = internal::ReadMatrix(distortion);
  if (matrix.rows() != 4 || matrix.cols() != 1 || terms.tail(2).cwiseAbs().maxCoeff() <= kMaxMeasuredDecentring) return;
  throw FormatError(
      distortion.place.path, distortion.place.where,
      "four coefficients in a column, as OpenCV's fisheye functions write them, and nothing says what lens it is; "
      "pass option 'lens' fisheye or perspective");
}

/// Coefficients under names of their own, k1, k2, p1, …, of entries without a list of them; empty: there are none.
/// Throws FormatError for k1 … k4 alone, a fisheye's terms, where nothing says what lens it is.
Eigen::VectorXd SingleTerms(const Entries& entries, geometry::LensKind kind, const internal::Place& lens) {
  const bool is_fisheye = kind == geometry::LensKind::kFisheye;
  const std::initializer_list<const char*> kPerspective = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  const std::initializer_list<const char*> kFisheye = {"k1", "k2", "k3", "k4"};
  const auto& names = is_fisheye ? kFisheye : kPerspective;
  Eigen::VectorXd terms = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(names.size()));
  Eigen::Index i = 0;
  bool any = false;
  for (const char* name : names) {
    const auto entry = entries.find(name);
    const bool number = entry != entries.end() && entry->second.value.kind == internal::Value::Kind::kNumber;
    if (number) terms[i] = internal::ReadNumber(*FindEntry(entries, name)), any = true;
    ++i;
  }
  if (!any) return {};
  const bool fourth_alone = !is_fisheye && terms[5] != 0 && terms.segment(2, 2).isZero(0) && terms.tail(2).isZero(0);
  if (fourth_alone && kind == geometry::LensKind::kUnsaid) {
    throw FormatError(lens.path, lens.where,
                      "beside it stand k1 to k4 without p1, p2, as of a fisheye lens, and nothing says what lens it is; pass "
                      "option 'lens' fisheye or perspective");
  }
  if (!is_fisheye && terms.tail(3).isZero(0)) terms.conservativeResize(5);
  return terms;
}

geometry::RigCamera ReadCamera(const Entries& entries, const std::string& name, const Entry& matrix, const Entry* distortion,
                               const Eigen::Vector2d& size, const ReadOptions& options, std::vector<Notice>* notes) {
  const geometry::LensKind kind = internal::LensKindOf(internal::LensWordsOf(entries), options, matrix.place);
  const bool is_fisheye = kind == geometry::LensKind::kFisheye;
  Eigen::VectorXd terms = internal::ReadDistortion(distortion);
  if (terms.size() == 0) terms = SingleTerms(entries, kind, matrix.place);
  if (distortion && terms.size() == 4 && kind == geometry::LensKind::kUnsaid) CheckKindIsSaid(*distortion, terms);
  Eigen::Matrix3d k = ReadMatrix3(matrix);
  if (IsJarvis(entries)) k.transposeInPlace();
  return internal::MakeRigCamera(name, size, k, terms, is_fisheye, options, matrix.place, notes);
}

void AddStereo(const Entries& entries, const StereoKeys& keys, const Eigen::Vector2d& size, const ReadOptions& options,
               ImportedRig* imported) {
  geometry::Rig& rig = imported->rig;
  const Entry *first = FindEntry(entries, keys.distortion1), *second = FindEntry(entries, keys.distortion2);
  if (first && !second)
    throw FormatError(first->place.path, first->place.where, "the other camera has no coefficients by such a name");
  rig.gauge = geometry::RigGauge::OfCamera("left");
  rig.cameras.push_back(ReadCamera(entries, "left", *FindEntry(entries, keys.matrix1), first, size, options, &imported->notes));
  rig.cameras.push_back(
      ReadCamera(entries, "right", *FindEntry(entries, keys.matrix2), second, size, options, &imported->notes));
  const Entry *rotation = FindFirst(entries, kRotationKeys), *translation = FindFirst(entries, kTranslationKeys);
  if (rotation && translation) {
    geometry::Rigid3& right = rig.cameras[1].cam_from_world;
    right = right * ReadPose(*rotation, *translation, options.metres_per_unit);
    imported->notes.push_back(internal::UnitNote(options.metres_per_unit));
  } else {
    internal::StateLensesOnly(imported);
  }
}

/// A camera from entries with one camera matrix; true when its place is in them.
bool AddSingle(const Entries& entries, const std::string& name, const std::string& path, const ReadOptions& options,
               ImportedRig* imported) {
  const Entry& matrix = IsOpenPose(entries) ? *FindEntry(entries, "intrinsics") : *FindFirst(entries, kOwnMatrixKeys);
  geometry::RigCamera camera = ReadCamera(entries, name, matrix, FindFirst(entries, kDistortionKeys),
                                          ReadSize(entries, path, options), options, &imported->notes);
  if (IsJarvis(entries) && imported->rig.cameras.empty())
    imported->notes.push_back(
        {"CAL-TRANSPOSED", "camera matrices and rotations stand transposed, as JARVIS writes them; they are transposed back",
         ""});
  const std::optional<geometry::Rigid3> pose = FindPose(entries, options.metres_per_unit);
  if (pose) camera.cam_from_world = camera.cam_from_world * *pose;
  internal::AddCamera(std::move(camera), matrix.place, &imported->rig);
  return pose.has_value();
}

/// What OpenCV's and ROS's calibration programs write beside the lens and the pose.
constexpr std::initializer_list<const char*> kHarmlessInOpenCv = {"calibrationtime",
                                                                  "calibrationdate",
                                                                  "nrofframes",
                                                                  "nframes",
                                                                  "boardwidth",
                                                                  "boardheight",
                                                                  "squaresize",
                                                                  "flags",
                                                                  "flagvalue",
                                                                  "aspectratio",
                                                                  "avgreprojectionerror",
                                                                  "reprojectionerror",
                                                                  "perviewreprojectionerrors",
                                                                  "extrinsicparameters",
                                                                  "imagepoints",
                                                                  "gridpoints",
                                                                  "rms",
                                                                  "error",
                                                                  "name",
                                                                  "cameraname",
                                                                  "cameraid",
                                                                  "rectificationmatrix",
                                                                  "header",
                                                                  "p",
                                                                  "projectionmatrix",
                                                                  "projectmatrix",
                                                                  "scalexy",
                                                                  "shiftxy",
                                                                  "e",
                                                                  "f",
                                                                  "r1",
                                                                  "r2",
                                                                  "p1",
                                                                  "p2",
                                                                  "q",
                                                                  "p",
                                                                  "rect",
                                                                  "validroi1",
                                                                  "validroi2",
                                                                  "header",
                                                                  "fixedpointusage",
                                                                  "fixedaspectratio",
                                                                  "boardtype",
                                                                  "calibrationpattern",
                                                                  "markersize"};

void AddUnusedNote(const std::vector<std::string>& paths, const std::vector<Entries>& files, const ReadOptions& options,
                   ImportedRig* imported) {
  geometry::UnusedKeys unused(paths.front(), options.metres_per_unit);
  for (const Entries& entries : files) internal::AddUnusedEntries(entries, kHarmlessInOpenCv, &unused);
  internal::AddUnusedNote(unused, imported);
}

/// The entries of all files; each may stand in one of them.
Entries Together(const std::vector<Entries>& files) {
  Entries all;
  for (const Entries& file : files) {
    for (const auto& [key, entry] : file) {
      if (all.emplace(key, entry).second) continue;
      throw FormatError(entry.place.path, "line " + std::to_string(entry.value.line),
                        "the key '" + entry.place.where + "' occurs twice");
    }
  }
  return all;
}

/// Several files of one camera each, named by the file.
ImportedRig ReadMany(const std::vector<std::string>& paths, const std::vector<Entries>& files, const ReadOptions& options) {
  ImportedRig imported;
  imported.rig.gauge.kind = geometry::RigGauge::Kind::kImported;
  std::vector<std::string> unplaced;
  for (size_t i = 0; i < paths.size(); ++i) {
    if (!AddSingle(files[i], internal::Stem(paths[i]), paths[i], options, &imported)) unplaced.push_back(paths[i]);
  }
  if (!unplaced.empty() && unplaced.size() < paths.size())
    throw FormatError(unplaced.front(), "R, T", "missing, and other files of these cameras have them: give all or none");
  if (unplaced.empty()) imported.notes.push_back(internal::UnitNote(options.metres_per_unit));
  if (!unplaced.empty()) RefuseOtherPoses(files), internal::StateLensesOnly(&imported);
  AddUnusedNote(paths, files, options, &imported);
  return imported;
}

/// Cameras in tables of their own. Sizes, and of two cameras the pose of the second, may stand beside them.
ImportedRig ReadNested(const std::string& path, const Entries& root, std::vector<internal::NestedCamera> cameras,
                       const ReadOptions& options) {
  ImportedRig imported;
  std::vector<Entries> files(1);
  size_t placed = 0;
  for (internal::NestedCamera& camera : cameras) {
    for (const char* key : {"imagewidth", "width", "imageheight", "height", "resolution", "imagesize", "imgsize"}) {
      if (const Entry* const size = FindEntry(root, key)) camera.entries.emplace(key, *size);
    }
    placed += AddSingle(camera.entries, camera.name, path, options, &imported);
    files.push_back(std::move(camera.entries));
  }
  const Entry *rotation = FindFirst(root, kRotationKeys), *translation = FindFirst(root, kTranslationKeys);
  std::vector<geometry::RigCamera>& read = imported.rig.cameras;
  const bool stereo = placed == 0 && read.size() == 2 && rotation && translation;
  if (stereo) read[1].cam_from_world = read[1].cam_from_world * ReadPose(*rotation, *translation, options.metres_per_unit);
  if (placed > 0 && placed < read.size())
    throw FormatError(path, "R, T", "some cameras have them and others do not: give all or none");
  imported.rig.gauge.kind = geometry::RigGauge::Kind::kImported;
  if (stereo) imported.rig.gauge = geometry::RigGauge::OfCamera(read[0].camera.name);
  if (stereo || placed > 0) imported.notes.push_back(internal::UnitNote(options.metres_per_unit));
  if (!stereo && placed == 0) RefuseOtherPoses(files), internal::StateLensesOnly(&imported);
  files[0] = root;  // with what was used
  AddUnusedNote({path}, files, options, &imported);
  return imported;
}

std::string LensText(const geometry::Camera& camera, const std::string& matrix_key, const std::string& distortion_key) {
  const internal::OpenCvLens lens = internal::OpenCvLensOf(camera);
  Eigen::RowVectorXd distortion =
      Eigen::RowVectorXd::Zero(std::max<Eigen::Index>(lens.distortion.size(), lens.fisheye ? 4 : 5));
  distortion.head(lens.distortion.size()) = lens.distortion.transpose();
  return internal::MatrixEntry(matrix_key, camera.K()) + internal::MatrixEntry(distortion_key, distortion);
}

std::string HeadText(const geometry::Camera& camera) {
  return "%YAML:1.0\n---\nimage_width: " + std::to_string(camera.width_px) +
         "\nimage_height: " + std::to_string(camera.height_px) + "\n" +
         (internal::OpenCvLensOf(camera).fisheye ? "fisheye_model: 1\n" : "");
}

std::string PoseText(const geometry::Rigid3& pose) {
  return internal::MatrixEntry("R", pose.rotation.toRotationMatrix()) + internal::MatrixEntry("T", pose.translation);
}

/// Two cameras that fit OpenCV's stereo sample: one image size, both lenses of one kind.
bool IsStereo(const geometry::Rig& rig) {
  if (rig.cameras.size() != 2) return false;
  const geometry::Camera &a = rig.cameras[0].camera, &b = rig.cameras[1].camera;
  return a.width_px == b.width_px && a.height_px == b.height_px &&
         internal::OpenCvLensOf(a).fisheye == internal::OpenCvLensOf(b).fisheye;
}

/// A table of cameras by name with K, R (camera from world), row by row, T, distCoeff and imgSize: AvatarReX, THuman4.
ImportedRig ReadByName(const std::string& path, const internal::Value& document, const ReadOptions& options) {
  const internal::ValueView root(path, document);
  ImportedRig imported;
  imported.rig.gauge.kind = geometry::RigGauge::Kind::kImported;
  geometry::UnusedKeys unused(path, options.metres_per_unit);
  for (const auto& [name, entry] : document.entries) {
    const internal::ValueView view = root[name];
    const auto square = [&](const char* key) -> Eigen::Matrix3d {
      const Eigen::VectorXd rows = view[key].Vector(9);
      return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
    };
    geometry::RigCamera camera =
        internal::MakeRigCamera(name, view["imgSize"].Vector(2), square("K"), view["distCoeff"].Vector(),
                                options.lens == geometry::LensKind::kFisheye, options, view.place(), &imported.notes);
    const geometry::Rigid3 pose{internal::MakeRotation(square("R"), view["R"].place()),
                                view["T"].Vector(3) * options.metres_per_unit};
    camera.cam_from_world = camera.cam_from_world * pose;
    internal::AddCamera(std::move(camera), view.place(), &imported.rig);
    internal::AddUnused(view, {"rectifyalpha"}, &unused);
  }
  imported.notes.push_back(internal::UnitNote(options.metres_per_unit));
  internal::AddUnusedNote(unused, &imported);
  return imported;
}

}  // namespace

ImportedRig ReadOpenCvYaml(const std::vector<std::string>& paths, const ReadOptions& options) {
  if (paths.empty()) throw UsageError("no OpenCV file given");
  if (internal::IsMatrixText(ReadFile(paths[0]))) return internal::ReadMatrixText(paths, options);
  if (const std::string text = paths.size() == 1 ? ReadFile(paths[0]) : ""; !text.empty()) {
    if (internal::IsMetashapeCameras(text)) return internal::ReadMetashape(paths[0], options);
    if (internal::IsOpenMvg(text)) return internal::ReadOpenMvg(paths[0], options);
    if (internal::HoldsCamerasByName(text)) return ReadByName(paths[0], internal::ParseLiteral(paths[0], text), options);
    if (internal::IsMatlab(text)) return internal::ReadMatlab(paths[0], options);
    if (internal::IsMultical(text)) return internal::ReadMultical(paths[0], options);
    if (internal::IsHuman36m(text)) return internal::ReadHuman36m(paths[0], options);
    if (internal::IsInterHand(text)) return internal::ReadInterHand(paths[0], options);
  }
  std::vector<Entries> files(paths.size());
  for (size_t i = 0; i < paths.size(); ++i) internal::ReadEntries(paths[i], true, &files[i]);
  if (std::all_of(files.begin(), files.end(), internal::IsVins)) return internal::ReadVins(paths, files, options);
  if (paths.size() == 1 && internal::IsOrbSlam(files[0])) return internal::ReadOrbSlam(paths[0], files[0], options);
  const bool one_each =
      std::all_of(files.begin(), files.end(), [](const Entries& entries) { return FindFirst(entries, kMatrixKeys); });
  if (paths.size() > 1 && one_each) return ReadMany(paths, files, options);
  if (paths.size() == 1 && internal::IsMcCalib(files[0])) return internal::ReadMcCalib(paths[0], files[0], options);
  ImportedRig imported;
  const Entries entries = Together(files);
  if (auto numbered = internal::NumberedCameras(entries, kMatrixKeys); !numbered.empty())
    return ReadNested(paths.front(), entries, std::move(numbered), options);
  if (const auto stereo = StereoKeysOf(entries)) {
    AddStereo(entries, *stereo, ReadSize(entries, paths.front(), options), options, &imported);
  } else if (FindFirst(entries, kMatrixKeys)) {
    const bool placed = AddSingle(entries, "camera", paths.front(), options, &imported);
    imported.rig.gauge =
        placed ? geometry::RigGauge{geometry::RigGauge::Kind::kImported} : geometry::RigGauge::OfCamera("camera");
    if (placed) imported.notes.push_back(internal::UnitNote(options.metres_per_unit));
  } else if (std::vector<internal::NestedCamera> cameras = internal::FindNestedCameras(entries, kOwnMatrixKeys);
             !cameras.empty()) {
    return ReadNested(paths.front(), entries, std::move(cameras), options);
  } else {
    const std::vector<std::string> matrices = internal::MatrixPaths(entries);
    throw FormatError(
        paths.front(), "",
        "no calibration in it: neither camera_matrix (cameraMatrix, K, mtx) nor M1 and M2 (K1 and K2, cameraMatrix1 and "
        "cameraMatrix2)" +
            (matrices.empty() ? "" : "; its matrices are " + SomeOf(matrices)));
  }
  AddUnusedNote(paths, {entries}, options, &imported);
  return imported;
}

internal::Files internal::WriteOpenCvYaml(const geometry::Rig& rig, const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  const bool is_file = extension == ".yml" || extension == ".yaml";
  if (is_file && IsStereo(rig)) {
    const geometry::Camera &left = rig.cameras[0].camera, &right = rig.cameras[1].camera;
    const geometry::Rigid3 right_from_left = rig.cameras[1].cam_from_world * Inverse(rig.cameras[0].cam_from_world);
    WriteFileAtomic(path,
                    HeadText(left) + LensText(left, "M1", "D1") + LensText(right, "M2", "D2") + PoseText(right_from_left));
    return {path};
  }
  if (is_file && rig.cameras.size() > 1) {
    throw UsageError(path + ": these " + std::to_string(rig.cameras.size()) +
                     " cameras do not fit into one of OpenCV's files; give a folder, a file for each is written there");
  }
  Files files;
  for (const geometry::RigCamera& camera : rig.cameras) {
    const std::string file = is_file ? path : path + "/" + FileName(camera.camera.name) + ".yml";
    WriteFileAtomic(file, HeadText(camera.camera) + LensText(camera.camera, "camera_matrix", "distortion_coefficients") +
                              PoseText(camera.cam_from_world));
    files.push_back(file);
  }
  return files;
}

}  // namespace mvstudio::calib
