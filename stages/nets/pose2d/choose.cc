#include "stages/nets/pose2d/choose.h"

#include <algorithm>
#include <limits>

#include "core/disk/kept_key.h"
#include "geometry/rig/rig_io.h"
#include "stages/nets/pose2d/existing.h"
#include "stages/nets/pose2d/kept.h"

namespace mvstudio::stages {
namespace {

constexpr char kChoiceKind[] = "choices";
/// To be raised whenever trials give other results than before.
constexpr char kChoiceVersion[] = "mvstudio choice of a net 1";

/// Nothing where some camera's footage cannot be read.
std::optional<std::string> ChoiceKey(const Pose2dOptions& options, const DetectJob& job, const geometry::Rig& rig,
                                     const std::vector<PoseBackend>& nets) {
  KeptKey key;
  key.Add(kChoiceVersion);
  key.Add(geometry::RigToJsonText(rig));
  key.Add(std::to_string(options.trial_frames));
  for (const dataset::CameraFootage& footage : job.footage) {
    for (const PoseBackend& net : nets) {
      const std::optional<std::string> camera = CameraPosesKey(job, footage, net);
      if (!camera) return std::nullopt;
      key.Add(footage.camera + " " + net.name + " " + *camera);
    }
  }
  return key.Take();
}

std::string EncodeTrials(const std::vector<Pose2dTrial>& trials) {
  KeptWriter out;
  out.Put<uint64_t>(trials.size());
  for (const Pose2dTrial& trial : trials) {
    out.Put(trial.backend);
    for (const double figure : {trial.agreement.median_px, trial.agreement.p90_px, trial.agreement.share_ok})
      out.Put<double>(figure);
  }
  return out.Take();
}

std::vector<Pose2dTrial> DecodeTrials(const std::string& bytes) {
  KeptReader in(bytes);
  std::vector<Pose2dTrial> trials(in.Count(1));
  for (Pose2dTrial& trial : trials) {
    trial.backend = in.Text();
    for (double* figure : {&trial.agreement.median_px, &trial.agreement.p90_px, &trial.agreement.share_ok})
      *figure = in.Get<double>();
  }
  if (!in.AtEnd()) throw DamagedBytes();
  return trials;
}

std::vector<Pose2dTrial> TryAllNets(const Pose2dOptions& options, const DetectJob& job, const geometry::Rig& rig,
                                    const std::vector<PoseBackend>& nets, const RunContext& run) {
  DetectJob trial = job;
  trial.overlays = 0;
  trial.cache.kind = CachePlace::Kind::kOff;  // a few frames are found quickly
  trial.max_frames = options.trial_frames;
  trial.every = std::max(options.every, FramesOf(job.footage[0]) / std::max(1, options.trial_frames));
  std::vector<Pose2dTrial> trials;
  for (const PoseBackend& net : nets) {
    const std::vector<CameraPoses> cameras = DetectPoses(trial, net, run);
    trials.push_back(
        {net.name, MeasureAgreement(PoseTracks(cameras), net.net->skeleton(), rig, options.pose.max_persons, run)});
  }
  return trials;
}

std::vector<Pose2dTrial> KeptOrTried(const Pose2dOptions& options, const DetectJob& job, const geometry::Rig& rig,
                                     const std::vector<PoseBackend>& nets, const RunContext& run) {
  const KeptResults kept(options.cache, kChoiceKind);
  const std::optional<std::string> key = kept.enabled() ? ChoiceKey(options, job, rig, nets) : std::nullopt;
  const std::optional<std::string> bytes = key ? kept.Load(*key) : std::nullopt;
  try {
    if (bytes) return DecodeTrials(*bytes);
  } catch (const DamagedBytes&) {
    kept.Damaged(*key);
  }
  std::vector<Pose2dTrial> trials = TryAllNets(options, job, rig, nets, run);
  if (key) kept.Store(*key, EncodeTrials(trials));
  return trials;
}

}  // namespace

std::vector<dataset::Pose2dTrack> PoseTracks(const std::vector<CameraPoses>& cameras) {
  std::vector<dataset::Pose2dTrack> tracks;
  for (const CameraPoses& camera : cameras) tracks.push_back(camera.track);
  return tracks;
}

std::string ChoosePoseBackend(const Pose2dOptions& options, const DetectJob& job, const geometry::Rig& rig,
                              const RunContext& run, std::vector<Pose2dTrial>* trials) {
  if (options.backend != "auto") return options.backend;
  const std::vector<std::string> names = InstalledPoseBackends(options.models);
  if (rig.cameras.size() < 2 || job.footage.size() < 2 || names.size() < 2) return names[0];
  std::vector<PoseBackend> nets;
  for (const std::string& name : names)
    nets.push_back(OpenPoseBackend(name, options.models, options.pose.quality, options.onnx));
  *trials = KeptOrTried(options, job, rig, nets, run);
  std::string best = names[0];
  double lowest = std::numeric_limits<double>::infinity();
  for (const Pose2dTrial& trial : *trials) {
    if (trial.agreement.median_px < lowest) lowest = trial.agreement.median_px, best = trial.backend;
  }
  return best;
}

}  // namespace mvstudio::stages
