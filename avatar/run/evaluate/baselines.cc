#include "avatar/run/evaluate/baselines.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "avatar/maps/bone_lists.h"
#include "core/check.h"
#include "core/error.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

// Mean of the plausible joints of the training frames, in world.
Eigen::Vector3d MeanPlace(const dataset::PanopticDataset& data, const DatasetSplit& split, int person) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const int frame : split.train_frames) {
    const dataset::Coco19Pose& pose = data.poses.at(frame).at(person);
    const std::array<bool, 19> plausible = dataset::PlausibleJoints(pose);
    for (int j = 0; j < 19; ++j) {
      if (plausible[j]) sum += pose.x_in_world.col(j), ++count;
    }
  }
  MVS_CHECK(count > 0, "no joint in any training frame");
  return sum / count;
}

int64_t NearestPose(const AvatarPack& candidates, const AvatarPack& truth, int64_t i) {
  int64_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int64_t k = 0; k < candidates.size(); ++k) {
    const double distance =
        PoseDistance(truth.joints_in_cam[i], truth.joint_valid[i], candidates.joints_in_cam[k], candidates.joint_valid[k]);
    if (distance < least) least = distance, best = k;
  }
  return best;
}

/// Training cameras of which the dataset has no image are none to choose from, but may be scored.
DatasetSplit WithImages(const dataset::PanopticDataset& data, DatasetSplit split) {
  const std::vector<std::string> without = dataset::FindMissing(data, split.train_cameras, split.train_frames).CamerasWithout();
  if (without.size() == split.train_cameras.size())
    throw FormatError(data.root, "", "holds no image that the run was trained on: the baselines are made of them");
  auto& cameras = split.train_cameras;
  const auto gone = [&](const std::string& name) { return std::count(without.begin(), without.end(), name) > 0; };
  split.holdout_cameras.insert(split.holdout_cameras.end(), without.begin(), without.end());
  cameras.erase(std::remove_if(cameras.begin(), cameras.end(), gone), cameras.end());
  return split;
}

}  // namespace

std::map<std::string, std::string> NearestTrainingCameras(const dataset::PanopticDataset& data, const DatasetSplit& split,
                                                          int person) {
  const Eigen::Vector3d place = MeanPlace(data, split, person);
  const auto direction = [&](const std::string& name) {
    return (data.rig.cameras.at(data.rig.Find(name)).CenterInWorld() - place).normalized().eval();
  };
  std::vector<std::string> targets = split.holdout_cameras;
  targets.insert(targets.end(), split.train_cameras.begin(), split.train_cameras.end());
  std::map<std::string, std::string> nearest;
  for (const std::string& target : targets) {
    double best = -2;
    for (const std::string& camera : split.train_cameras) {
      const double cosine = direction(target).dot(direction(camera));
      if (cosine > best) best = cosine, nearest[target] = camera;
    }
  }
  return nearest;
}

double PoseDistance(const at::Tensor& joints_a, const at::Tensor& valid_a, const at::Tensor& joints_b,
                    const at::Tensor& valid_b) {
  const int body = NumBodyJoints(joints_a.size(0)), center = CenterJoint(joints_a.size(0));
  const auto a = joints_a.accessor<float, 2>(), b = joints_b.accessor<float, 2>();
  const auto va = valid_a.accessor<bool, 1>(), vb = valid_b.accessor<bool, 1>();
  const bool centred = va[center] && vb[center];
  int count = 0;
  double sum[3] = {0, 0, 0};
  for (int j = 0; j < body; ++j) {
    if (!va[j] || !vb[j]) continue;
    ++count;
    for (int k = 0; k < 3; ++k) sum[k] += static_cast<double>(a[j][k]) - b[j][k];
  }
  if (count == 0) return std::numeric_limits<double>::infinity();
  double total = 0;
  for (int j = 0; j < body; ++j) {
    if (!va[j] || !vb[j]) continue;
    for (int k = 0; k < 3; ++k) {
      const double shift = centred ? static_cast<double>(a[center][k]) - b[center][k] : sum[k] / count;
      const double difference = static_cast<double>(a[j][k]) - b[j][k] - shift;
      total += difference * difference;
    }
  }
  return total / count;
}

at::Tensor OnBlack(const AvatarPack& pack) {
  return pack.images.to(at::kDouble) / 255 * pack.masks.gt(0).unsqueeze(1).to(at::kDouble);
}

Baselines MakeBaselines(const dataset::PanopticDataset& data, const DatasetSplit& split, const TrainingSetOptions& crop,
                        const AvatarPack& truth, const RunContext& run) {
  Baselines baselines;
  baselines.nearest_camera = NearestTrainingCameras(data, WithImages(data, split), ChoosePerson(data, crop.person));
  BaselineImages& mean = baselines.mean_image;
  BaselineImages& pose = baselines.nearest_pose;
  mean.images = at::zeros(truth.images.sizes(), at::kDouble), mean.masks = at::zeros(truth.masks.sizes(), at::kDouble);
  pose.images = at::zeros_like(mean.images), pose.masks = at::zeros_like(mean.masks);
  for (size_t c = 0; c < truth.cameras.size(); ++c) {
    TrainingSetOptions options = crop;
    options.template_maps = options.template_colours = false, options.template_input_px = 0, options.fitted = nullptr;
    options.keep_views = false;
    options.cameras = {baselines.nearest_camera.at(truth.cameras[c])};
    options.frames = split.train_frames;
    const AvatarPack train = BuildTrainingSet(data, options, run).pack;
    const at::Tensor images = OnBlack(train), masks = train.masks.gt(0).to(at::kDouble);
    const at::Tensor mean_image = images.mean(0), mean_mask = masks.mean(0);
    for (int64_t i = 0; i < truth.size(); ++i) {
      if (truth.camera_idx[i].item<int64_t>() != static_cast<int64_t>(c)) continue;
      const int64_t k = NearestPose(train, truth, i);
      mean.images[i].copy_(mean_image), mean.masks[i].copy_(mean_mask);
      pose.images[i].copy_(images[k]), pose.masks[i].copy_(masks[k]);
    }
  }
  return baselines;
}

}  // namespace mvstudio::avatar
