#include <algorithm>
#include <filesystem>

#include "calib/formats/formats.h"
#include "exports/writers.h"

/// https://colmap.github.io/format.html: sparse/0 with the cameras, images/, and masks/ under the names that COLMAP's
/// `--ImageReader.mask_path` looks for.
namespace mvstudio::exports {
namespace {

std::array<uint8_t, 3> PersonColour(int index) {
  constexpr std::array<uint8_t, 3> kColours[] = {{230, 60, 40}, {40, 120, 230}, {40, 170, 80}, {230, 170, 30}};
  return kColours[static_cast<size_t>(index) % 4];
}

/// The joints, seen by every camera in whose picture they lie. The error is that of the numbers as they are written.
std::vector<calib::ColmapModelPoint> JointPoints(const Take& take, int frame, const std::vector<size_t>& views) {
  std::vector<geometry::Projector> projectors;
  for (const size_t i : views) projectors.emplace_back(take.views[i].camera.camera);
  std::vector<calib::ColmapModelPoint> points;
  int person = 0;
  for (const auto& [id, pose] : take.At(frame)) {
    for (int j = 0; j < 19; ++j) {
      if (!pose.valid[j]) continue;
      calib::ColmapModelPoint point;
      point.x_in_world = pose.x_in_world.col(j);
      point.rgb = PersonColour(person);
      for (size_t c = 0; c < views.size(); ++c) {
        const geometry::RigCamera& camera = take.views[views[c]].camera;
        const geometry::Projection seen = projectors[c].Project(camera.cam_from_world * point.x_in_world);
        if (seen.status == Status::kOk && InImage(camera.camera, seen.px)) point.track.push_back({c, seen.px});
      }
      if (point.track.size() >= 2) points.push_back(std::move(point));
    }
    ++person;
  }
  return points;
}

/// By name: `colmap feature_extractor` numbers the images so, and `point_triangulator` goes by the numbers.
std::vector<size_t> SortedViews(const Take& take) {
  std::vector<size_t> views = AllViews(take);
  std::sort(views.begin(), views.end(), [&](size_t a, size_t b) { return take.views[a].info.name < take.views[b].info.name; });
  return views;
}

void WriteInstant(const Job& job, int frame, const std::string& prefix) {
  const std::vector<size_t> views = SortedViews(job.take);
  std::vector<std::string> images;
  for (const size_t i : views) {
    const std::string& name = job.take.views[i].info.name;
    const std::string file = job.pictures.AddPicture(i, frame, prefix + "images/" + name);
    const std::string image = file.empty() ? name + ".jpg" : std::filesystem::path(file).filename().string();
    images.push_back(image);
    job.pictures.AddMask(i, frame, prefix + "masks/" + image + ".png");
  }
  const auto points = JointPoints(job.take, frame, views);
  const std::string model = prefix + "sparse/0";
  calib::WriteColmapModel(RigOf(job.take, views), images, points, job.folder + "/" + model);
  for (const char* name : {"cameras", "images", "points3D"}) {
    for (const char* extension : {".bin", ".txt"}) job.report->files.push_back(model + "/" + name + extension);
  }
  if (!job.take.split) return;
  std::string test;
  for (size_t i = 0; i < views.size(); ++i) {
    if (job.take.views[views[i]].info.part == "test") test += images[i] + "\n";
  }
  job.Write(model + "/test.txt", test);
}

}  // namespace

void WriteColmap(const Job& job) {
  for (const int frame : job.take.frames) {
    WriteInstant(job, frame, job.take.frames.size() > 1 ? Numbered("frame_", frame, 8, "/") : "");
  }
}

}  // namespace mvstudio::exports
