#include <algorithm>
#include <filesystem>

#include "calib/formats/formats.h"
#include "dataset/exports/writers.h"

/// https://colmap.github.io/format.html: sparse/0 with the cameras, images/, and masks/ under the names that COLMAP's
/// `--ImageReader.mask_path` looks for.
namespace mvstudio::exports {
namespace {

std::array<uint8_t, 3> PersonColour(int index) {
  constexpr std::array<uint8_t, 3> kColours[] = {{230, 60, 40}, {40, 120, 230}, {40, 170, 80}, {230, 170, 30}};
  return kColours[static_cast<size_t>(index) % 4];
}

/// The joints, a colour per person, seen by every camera in whose image they lie.
std::vector<StartPoint> JointPoints(const Take& take, const std::vector<geometry::Projector>& projectors, int frame) {
  std::vector<StartPoint> points;
  int person = 0;
  for (const auto& [id, pose] : take.At(frame)) {
    for (int j = 0; j < 19; ++j) {
      if (!pose.valid[j]) continue;
      const Eigen::Vector3d x = pose.x_in_world.col(j);
      StartPoint point{{x, PersonColour(person)}, ViewsAround(take, projectors, x)};
      if (point.seen_by.size() >= 2) points.push_back(std::move(point));
    }
    ++person;
  }
  return points;
}

/// With a track through the images that see each point. Its error is 0: the features are its projections.
std::vector<calib::ColmapModelPoint> ModelPoints(const Job& job, int frame, const std::vector<size_t>& views) {
  const std::vector<geometry::Projector> projectors = ProjectorsOf(job.take);
  std::vector<StartPoint> start = StartPoints(job, frame);
  if (start.empty()) {
    start = JointPoints(job.take, projectors, frame);
    job.report->points += static_cast<int>(start.size());
  }
  std::vector<size_t> place_of(views.size());
  for (size_t c = 0; c < views.size(); ++c) place_of[views[c]] = c;
  std::vector<calib::ColmapModelPoint> points;
  for (const StartPoint& from : start) {
    calib::ColmapModelPoint point{from.x_in_world, from.rgb, 0, {}};
    for (const size_t i : from.seen_by) {
      const Eigen::Vector3d x_in_cam = job.take.views[i].camera.cam_from_world * from.x_in_world;
      point.track.push_back({place_of[i], projectors[i].Project(x_in_cam).px});
    }
    points.push_back(std::move(point));
  }
  return points;
}

/// Gaussian splatting's loader makes points3D.ply of points3D.bin where it is missing; a file of the export's own stays
/// known to `overwrite`.
void WritePlyBeside(const Job& job, const std::vector<calib::ColmapModelPoint>& points, const std::string& model) {
  std::vector<ColouredPoint> coloured;
  for (const calib::ColmapModelPoint& point : points) coloured.push_back({point.x_in_world, point.rgb});
  job.Write(model + "/points3D.ply", PlyBinary(coloured));
}

/// By name: `colmap feature_extractor` numbers the images so, and `point_triangulator` goes by the numbers.
std::vector<size_t> SortedViews(const Take& take) {
  std::vector<size_t> views = AllViews(take);
  std::sort(views.begin(), views.end(), [&](size_t a, size_t b) { return take.views[a].info.name < take.views[b].info.name; });
  return views;
}

void WriteTimeStep(const Job& job, int frame, const std::string& prefix) {
  const std::vector<size_t> views = SortedViews(job.take);
  std::vector<std::string> images;
  for (const size_t i : views) {
    const std::string& name = job.take.views[i].info.name;
    const std::string file = job.images.AddImage(i, frame, prefix + "images/" + name);
    const std::string image = file.empty() ? name + ".jpg" : std::filesystem::path(file).filename().string();
    images.push_back(image);
    job.images.AddMask(i, frame, prefix + "masks/" + image + ".png");
  }
  const auto points = ModelPoints(job, frame, views);
  const std::string model = prefix + "sparse/0";
  calib::WriteColmapModel(RigOf(job.take, views), images, points, job.folder + "/" + model);
  for (const char* name : {"cameras", "images", "points3D"}) {
    for (const char* extension : {".bin", ".txt"}) job.report->files.push_back(model + "/" + name + extension);
  }
  WritePlyBeside(job, points, model);
  if (!job.take.split) return;
  std::string test;
  for (size_t i = 0; i < views.size(); ++i) {
    if (job.take.views[views[i]].info.part == dataset::PartOfSplit::kTest) test += images[i] + "\n";
  }
  job.Write(model + "/test.txt", test);
}

}  // namespace

void WriteColmap(const Job& job) {
  for (const int frame : job.take.frames) {
    WriteTimeStep(job, frame, job.take.frames.size() > 1 ? Numbered("frame_", frame, 8, "/") : "");
  }
}

}  // namespace mvstudio::exports
