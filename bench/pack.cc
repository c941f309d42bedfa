#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/random.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/views/crop.h"
#include "stages/pack_speed/measure.h"

/// bench_pack [SEED] [JSON or -] [DATASET or -] [FRAMES]: random access to crops of people, packs beside a folder of JPEG
/// images cropped when read, on a made studio of 1920x1080 images and on the dataset when given. See docs/packs.md.
namespace mvstudio {
namespace {

constexpr int kWidth = 1920, kHeight = 1080, kCameras = 4;
constexpr double kPi = 3.14159265358979323846;

geometry::RigCamera MakeCamera(int index) {
  const double angle = 2 * kPi * index / kCameras + 0.3;
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("00_0" + std::to_string(index), kWidth, kHeight, 1500);
  camera.camera.model = geometry::LensModel::kBrown5;
  camera.camera.params.resize(9);
  camera.camera.params << 1500, 1501, 958.3, 541.2, -0.25, 0.2, 4e-4, -3e-4, -0.03;
  const Eigen::Vector3d centre(3.2 * std::cos(angle), 3.2 * std::sin(angle), 1.3);
  const Eigen::Vector3d forward = (Eigen::Vector3d(0, 0, 0.95) - centre).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d cam_from_world;
  cam_from_world << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  camera.cam_from_world = {Eigen::Quaterniond(cam_from_world), -(cam_from_world * centre)};
  return camera;
}

dataset::Coco19Pose MakePose(double phase) {
  const double joints[19][3] = {{0, 0, 1.45},       {0, -0.1, 1.6},  {0, 0, 0.95},        {0.18, 0, 1.42}, {0.34, 0, 1.2},
                                {0.48, 0, 1.0},     {0.1, 0, 0.93},  {0.14, 0, 0.5},      {0.16, 0, 0.1},  {-0.18, 0, 1.42},
                                {-0.34, 0, 1.2},    {-0.48, 0, 1.0}, {-0.1, 0, 0.93},     {-0.14, 0, 0.5}, {-0.16, 0, 0.1},
                                {0.03, -0.1, 1.64}, {0.07, 0, 1.62}, {-0.03, -0.1, 1.64}, {-0.07, 0, 1.62}};
  dataset::Coco19Pose pose;
  for (int j = 0; j < 19; ++j) {
    pose.x_in_world.col(j) << joints[j][0] + 0.2 * std::sin(phase), joints[j][1] + 0.2 * std::cos(phase), joints[j][2];
    pose.valid[j] = true, pose.confidence[j] = 1;
  }
  pose.x_in_world(2, 5) += 0.5 * (1 + std::sin(2 * phase));
  return pose;
}

/// Waves from 5 px to 300 px, fainter the finer and with less colour than brightness, as in photographs, and noise of 1.5
/// levels.
Image MakeImage(uint64_t seed) {
  constexpr int kWaves = 14;
  Rng rng(seed);
  double waves[kWaves][7];  // frequencies, size, phases of the colours, share of colour
  for (int k = 0; k < kWaves; ++k) {
    const double period = 5 * std::pow(60, static_cast<double>(k) / (kWaves - 1)), angle = rng.Uniform(0, 2 * kPi);
    waves[k][0] = 2 * kPi / period * std::cos(angle), waves[k][1] = 2 * kPi / period * std::sin(angle);
    waves[k][2] = 1.6 * std::pow(period, 0.55);
    for (int c = 3; c < 6; ++c) waves[k][c] = rng.Uniform(0, 2 * kPi);
    waves[k][6] = std::min(0.4, period / 100);
  }
  Image image(kWidth, kHeight, 3);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      float sum[3] = {127.5f, 127.5f, 127.5f};
      for (const auto& w : waves) {
        const float at = static_cast<float>(w[0] * x + w[1] * y), grey = std::sin(at);
        for (int c = 0; c < 3; ++c) {
          sum[c] += static_cast<float>(w[2]) * (grey + static_cast<float>(w[6]) * std::sin(at + static_cast<float>(w[3 + c])));
        }
      }
      const double noise = 1.5 * (rng.Uniform() + rng.Uniform() + rng.Uniform() + rng.Uniform() - 2) * std::sqrt(3.0);
      for (int c = 0; c < 3; ++c) {
        image.Pixel(x, y)[c] = static_cast<uint8_t>(std::lround(std::clamp<double>(sum[c] + noise, 0, 255)));
      }
    }
  }
  return image;
}

/// Writes the made studio twice: as JPEG (quality 95) and as PNG.
void MakeStudio(const std::string& jpeg, const std::string& png, int frames, uint64_t seed) {
  geometry::Rig rig;
  for (int c = 0; c < kCameras; ++c) rig.cameras.push_back(MakeCamera(c));
  for (const std::string& root : {jpeg, png}) {
    dataset::WritePanopticCalibration(rig, root + "/calibration_made.json", "made");
    for (int f = 0; f < frames; ++f) {
      dataset::WriteBody3dScene({{0, MakePose(0.4 * f)}}, 40.0 * f,
                                root + Format("/hdPose3d_stage1_coco19/body3DScene_%08d.json", f));
    }
  }
  ParallelFor(int64_t{frames} * kCameras, 0, [&](int64_t i) {
    const Image image = MakeImage(seed * 1000003 + static_cast<uint64_t>(i));
    const std::string name = Format("/hdImgs/00_%02d/00_%02d_%08d", static_cast<int>(i % kCameras),
                                    static_cast<int>(i % kCameras), static_cast<int>(i / kCameras));
    dataset::WriteImage(image, jpeg + name + ".jpg", 95);
    dataset::WriteImage(image, png + name + ".png");
  });
}

/// The images of a dataset seen by cameras of 1920x1080 with the same height of view.
void Enlarge(const std::string& from, const std::string& to, int frames) {
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(from);
  geometry::Rig rig;
  for (const geometry::RigCamera& camera : data.rig.cameras) {
    geometry::RigCamera large = camera;
    const double scale = static_cast<double>(kHeight) / camera.camera.height_px;
    large.camera = geometry::MakePinhole(camera.camera.name, kWidth, kHeight, scale * camera.camera.fy());
    rig.cameras.push_back(large);
  }
  dataset::WritePanopticCalibration(rig, to + "/calibration_enlarged.json", "enlarged");
  const int64_t count = std::min<int64_t>(frames, static_cast<int64_t>(data.frames.size())),
                cameras = static_cast<int64_t>(rig.cameras.size());
  ParallelFor(count * cameras, 0, [&](int64_t i) {
    const int frame = data.frames[static_cast<size_t>(i / cameras) * data.frames.size() / static_cast<size_t>(count)];
    const std::string& name = rig.cameras[i % cameras].camera.name;
    const dataset::ResampleMap map(data.rig.cameras[i % cameras], rig.cameras[i % cameras]);
    const std::string file = Format("/%s/%s_%08d", name.c_str(), name.c_str(), frame);
    dataset::WriteImage(map.Apply(dataset::ReadImage(data.ImagePath(name, frame)), dataset::Border::kLeave),
                        to + "/hdImgs" + file + ".jpg", 95);
    dataset::WriteImage(map.Mask(dataset::ReadImage(data.MaskPath(name, frame), true)), to + "/masks" + file + ".png");
    if (i % cameras) return;
    dataset::WriteBody3dScene(data.poses.at(frame), 40.0 * frame,
                              to + Format("/hdPose3d_stage1_coco19/body3DScene_%08d.json", frame));
  });
}

nlohmann::ordered_json Measure(const std::string& title, const std::string& root, stages::PackSpeedOptions options) {
  const stages::PackSpeedReport report = stages::MeasurePackSpeed(root, options, {});
  const std::vector<bool> none(report.trials.size(), false);
  std::printf("== %s\n%s", title.c_str(), stages::PackSpeedText(report, none).c_str());
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(stages::PackSpeedJson(report, none));
  json["what"] = title;
  return json;
}

struct TempFolder {
  std::string path;
  TempFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "bench-pack-XXXXXX").string();
    path = mkdtemp(pattern.data());
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
};

int Main(int argc, char** argv) {
  const uint64_t seed = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1;
  const std::string json_path = argc > 2 ? argv[2] : "-", given = argc > 3 ? argv[3] : "-";
  const int frames = argc > 4 ? std::max(1, std::atoi(argv[4])) : 6;
  const TempFolder folder;
  stages::PackSpeedOptions options;
  const ScratchFolder work(folder.path);
  options.frames = frames, options.work = work.path();
  options.codecs = {"raw", "png", "jpeg:90", "jpeg:95", "jpeg:98"}, options.crops = {128, 256};
  nlohmann::ordered_json all{{"seed", seed}, {"runs", nlohmann::ordered_json::array()}};
  MakeStudio(folder.path + "/jpeg", folder.path + "/png", frames, seed);
  options.lossless = folder.path + "/png";
  all["runs"].push_back(Measure("made studio, 1920x1080", folder.path + "/jpeg", options));
  options.lossless.clear();
  if (given != "-") {
    all["runs"].push_back(Measure(given, given, options));
    Enlarge(given, folder.path + "/large", frames);
    all["runs"].push_back(Measure(given + " enlarged to 1920x1080", folder.path + "/large", options));
  }
  if (json_path != "-") WriteFileAtomic(json_path, all.dump(1) + "\n");
  return 0;
}

}  // namespace
}  // namespace mvstudio

int main(int argc, char** argv) {
  try {
    return mvstudio::Main(argc, argv);
  } catch (const mvstudio::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 3;
  }
}
