#include "calib/points/colmap_program.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>

#include "calib/board/pixel_origin.h"
#include "calib/formats/formats.h"
#include "core/check.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/parallel.h"
#include "core/process.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;
namespace fs = std::filesystem;

std::string FindProgram(const std::string& name) {
  const auto runs = [](const std::string& path) { return access(path.c_str(), X_OK) == 0 && fs::is_regular_file(path); };
  if (name.find('/') != std::string::npos && runs(name)) return name;
  std::istringstream folders(std::getenv("PATH") ? std::getenv("PATH") : "");
  for (std::string folder; name.find('/') == std::string::npos && std::getline(folders, folder, ':');) {
    if (!folder.empty() && runs(folder + "/" + name)) return folder + "/" + name;
  }
  throw MissingToolError("the program '" + name +
                         "' is not there; install COLMAP (Debian: apt install colmap) or say where it is "
                         "with option 'colmap'");
}

/// The last lines of a log, for a message.
std::string Tail(const std::string& path) {
  std::istringstream lines(ReadFile(path));
  std::string line, last;
  while (std::getline(lines, line)) {
    if (line.find_first_not_of(" \t\r=") != std::string::npos) last = line;
  }
  return last.substr(0, 200);
}

/// Runs a program to its end, stdout and stderr appended to `log`. Stops it when the run is cancelled.
void RunProgram(const std::vector<std::string>& words, const std::string& log, ProgressStage* stage) {
  const int exit = RunProcess(words, {log, "", true, ""}, [&] { stage->Advance(0, words[1]); });
  if (exit == 0) return;
  const std::string how =
      exit > 128 ? "was killed by signal " + std::to_string(exit - 128) : "ended with exit status " + std::to_string(exit);
  throw IoError(log, "colmap " + words[1] + " " + how + "; its last line: " + Tail(log));
}

/// colmap's mapper ends with an error when no two images fit together; that is the scene's fault.
bool SaysNoModel(const std::string& log) {
  const std::string text = ReadFile(log);
  return text.find("failed to create sparse model") != std::string::npos ||
         text.find("No good initial image pair found") != std::string::npos;
}

std::string Numbers(const std::vector<double>& values) {
  return Join(values, ",", [](double value) { return Format("%.17g", value); });
}

/// Name and parameters of colmap's model for a lens; one that is not known gets a focal length and two radial terms.
std::pair<std::string, std::string> ToColmap(const geometry::Camera& lens, bool known) {
  const double cx = lens.cx() + kCornerOriginShiftPx, cy = lens.cy() + kCornerOriginShiftPx;
  if (!known) return {"RADIAL", Numbers({(lens.fx() + lens.fy()) / 2, cx, cy, 0, 0})};
  std::vector<double> params = {lens.fx(), lens.fy(), cx, cy};
  const Eigen::VectorXd k = lens.params.tail(lens.params.size() - 4);
  const auto add = [&](int count) {
    for (int i = 0; i < count; ++i) params.push_back(i < k.size() ? k[i] : 0);
  };
  switch (lens.model) {
    case LensModel::kPinhole:
      return {"PINHOLE", Numbers(params)};
    case LensModel::kBrown1:
    case LensModel::kBrown2:
    case LensModel::kBrown4:
      add(4);
      return {"OPENCV", Numbers(params)};
    case LensModel::kBrown5:
    case LensModel::kRational8:
      add(8);
      return {"FULL_OPENCV", Numbers(params)};
    case LensModel::kKannalaBrandt4:
      add(4);
      return {"OPENCV_FISHEYE", Numbers(params)};
    default:
      throw UsageError("camera " + lens.name + ": colmap has no lens model like " + std::string(ToString(lens.model)) +
                       "; use brown4, rational8 or kannala4");
  }
}

struct Project {
  std::string folder, program, database, log;
  int threads = 1;
};

void ExtractFrom(const std::vector<std::string>& names, const SceneImage& image, const Project& work,
                 const ColmapOptions& options, ProgressStage* stage) {
  std::string list;
  for (const std::string& name : names) list += name + "\n";
  WriteFileAtomic(work.folder + "/list.txt", list);
  const auto [model, params] = ToColmap(image.lens, image.lens_known);
  RunProgram({work.program,
              "feature_extractor",
              "--database_path",
              work.database,
              "--image_path",
              work.folder + "/images",
              "--image_list_path",
              work.folder + "/list.txt",
              "--ImageReader.single_camera",
              "1",
              "--ImageReader.camera_model",
              model,
              "--ImageReader.camera_params",
              params,
              "--SiftExtraction.use_gpu",
              "0",
              "--SiftExtraction.num_threads",
              std::to_string(work.threads),
              "--SiftExtraction.max_num_features",
              std::to_string(options.max_features)},
             work.log, stage);
  stage->Advance(static_cast<int64_t>(names.size()), image.camera);
}

/// Images whose lenses are not known share one, those of a size.
void ExtractFeatures(const std::vector<SceneImage>& images, const Project& work, const ColmapOptions& options,
                     ProgressStage* stage) {
  MakeFolder(work.folder + "/images");
  std::map<std::pair<int, int>, std::pair<const SceneImage*, std::vector<std::string>>> unknown;
  for (const SceneImage& image : images) {
    const std::string name = image.camera + fs::path(image.path).extension().string();
    MakeSymbolicLink(fs::absolute(image.path).string(), work.folder + "/images/" + name);
    if (image.lens_known) {
      ExtractFrom({name}, image, work, options, stage);
    } else {
      auto& [first, names] = unknown[{image.lens.width_px, image.lens.height_px}];
      first = &image;
      names.push_back(name);
    }
  }
  for (const auto& [size, group] : unknown) ExtractFrom(group.second, *group.first, work, options, stage);
}

void Map(const std::vector<SceneImage>& images, const Project& work, ProgressStage* stage) {
  bool known = true;
  for (const SceneImage& image : images) known &= image.lens_known;
  const std::string threads = std::to_string(work.threads), refine = known ? "0" : "1";
  RunProgram({work.program, "exhaustive_matcher", "--database_path", work.database, "--SiftMatching.use_gpu", "0",
              "--SiftMatching.num_threads", threads},
             work.log, stage);
  stage->Advance(1, "matching");
  MakeFolder(work.folder + "/model");
  const std::vector<std::string> mapper = {work.program,
                                           "mapper",
                                           "--database_path",
                                           work.database,
                                           "--image_path",
                                           work.folder + "/images",
                                           "--output_path",
                                           work.folder + "/model",
                                           "--Mapper.num_threads",
                                           threads,
                                           "--Mapper.multiple_models",
                                           "0",
                                           "--Mapper.min_model_size",
                                           "2",
                                           "--Mapper.extract_colors",
                                           "0",
                                           "--Mapper.init_min_tri_angle",
                                           "4",
                                           "--Mapper.tri_ignore_two_view_tracks",
                                           "0",
                                           "--Mapper.ba_refine_focal_length",
                                           refine,
                                           "--Mapper.ba_refine_extra_params",
                                           refine};
  try {
    RunProgram(mapper, work.log, stage);
  } catch (const IoError&) {
    if (!SaysNoModel(work.log)) throw;
  }
  stage->Advance(1, "mapping");
}

/// Little-endian values with a check against the end of the file.
class BinaryReader {
 public:
  explicit BinaryReader(const std::string& path) : path_(path), text_(ReadFile(path)) {}
  template <class T>
  T Get() {
    T value;
    if (text_.size() - at_ < sizeof value) Fail("the file is truncated");
    std::memcpy(&value, text_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  /// A count of things that take at least `bytes` each.
  uint64_t Count(size_t bytes) {
    const auto count = Get<uint64_t>();
    if (count > (text_.size() - at_) / bytes) Fail("a count is larger than the file");
    return count;
  }
  std::string Text() {
    const size_t end = text_.find('\0', at_);
    if (end == std::string::npos) Fail("a name does not end");
    std::string text = text_.substr(at_, end - at_);
    at_ = end + 1;
    return text;
  }
  Eigen::Vector3d Vector3() {
    const double x = Get<double>(), y = Get<double>(), z = Get<double>();
    if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z)) Fail("a number is not finite");
    return {x, y, z};
  }
  void Skip(size_t bytes) {
    if (text_.size() - at_ < bytes) Fail("the file is truncated");
    at_ += bytes;
  }
  [[noreturn]] void Fail(const std::string& what) const { throw FormatError(path_, "byte " + std::to_string(at_), what); }

 private:
  std::string path_, text_;
  size_t at_ = 0;
};

std::map<uint64_t, int> ReadPoints(const std::string& path, Eigen::Matrix3Xd* points) {
  BinaryReader in(path);
  const uint64_t count = in.Count(8 + 24 + 3 + 8 + 8);
  points->resize(3, static_cast<Eigen::Index>(count));
  std::map<uint64_t, int> index;
  for (uint64_t i = 0; i < count; ++i) {
    index[in.Get<uint64_t>()] = static_cast<int>(i);
    points->col(static_cast<Eigen::Index>(i)) = in.Vector3();
    in.Skip(3 + 8);  // colour, error
    in.Skip(in.Count(8) * 8);
  }
  return index;
}

std::vector<std::string> PathsOf(const std::vector<SceneImage>& images) {
  std::vector<std::string> paths;
  for (const SceneImage& image : images) paths.push_back(image.path);
  return paths;
}

}  // namespace

bool ColmapCanCarry(LensModel model) {
  return model == LensModel::kPinhole || model == LensModel::kBrown1 || model == LensModel::kBrown2 ||
         model == LensModel::kBrown4 || model == LensModel::kBrown5 || model == LensModel::kRational8 ||
         model == LensModel::kKannalaBrandt4;
}

geometry::Camera GuessLens(const std::string& camera, int width_px, int height_px) {
  geometry::Camera lens = geometry::MakePinhole(camera, width_px, height_px, 1.2 * std::max(width_px, height_px));
  lens.model = LensModel::kBrown2;
  lens.params.conservativeResizeLike(Eigen::VectorXd::Zero(6));
  return lens;
}

ColmapScene ReadColmapScene(const std::string& folder) {
  ColmapScene scene;
  scene.rig = ReadColmap(folder).rig;
  const std::map<uint64_t, int> point_idx = ReadPoints(folder + "/points3D.bin", &scene.points);
  BinaryReader in(folder + "/images.bin");
  const uint64_t count = in.Count(4 + 56 + 4 + 1 + 8);
  for (uint64_t i = 0; i < count; ++i) {
    in.Skip(4 + 56 + 4);
    const std::string name = fs::path(in.Text()).stem().string();
    const int image = scene.rig.Find(name);
    if (image < 0) in.Fail("an image that the cameras do not have");
    for (uint64_t n = in.Count(24); n > 0; --n) {
      const double x = in.Get<double>(), y = in.Get<double>();
      const auto found = point_idx.find(in.Get<uint64_t>());
      if (found == point_idx.end()) continue;
      if (!std::isfinite(x) || !std::isfinite(y)) in.Fail("a number is not finite");
      scene.tracks.push_back({image, found->second, Eigen::Vector2d(x - kCornerOriginShiftPx, y - kCornerOriginShiftPx)});
    }
  }
  return scene;
}

ColmapScene RunColmap(const std::vector<SceneImage>& images, const std::string& work_folder, const ColmapOptions& options,
                      const RunContext& run) {
  const std::string program = FindProgram(options.program);
  AtomicFolder output(work_folder, true, PathsOf(images));
  const Project work{output.work_path(), program, output.work_path() + "/database.db", output.work_path() + "/colmap.log",
                     ResolveThreads(run.num_threads)};
  ProgressStage stage(run, "colmap", static_cast<int64_t>(images.size()) + 2);
  ExtractFeatures(images, work, options, &stage);
  Map(images, work, &stage);
  const std::string model = work.folder + "/model/0";
  ColmapScene scene = fs::exists(model + "/images.bin") ? ReadColmapScene(model) : ColmapScene();
  output.Commit();
  return scene;
}

}  // namespace mvstudio::calib
