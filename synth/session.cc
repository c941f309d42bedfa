#include "synth/session.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <functional>
#include <memory>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"
#include "geometry/rig/rig_io.h"
#include "synth/board_view.h"
#include "synth/body_scene.h"
#include "synth/detections.h"
#include "synth/lens_rays.h"
#include "synth/motion.h"
#include "synth/plate.h"
#include "synth/recorder.h"
#include "synth/room.h"
#include "synth/subject.h"
#include "synth/textured_room.h"
#include "synth/truth_io.h"

namespace mvstudio::synth {
namespace {

constexpr int kBatch = 8;  // frames rendered before they are encoded

/// Everything that stays the same during a session.
struct Studio {
  const SynthOptions& options;
  const RunContext& run;
  std::string folder;
  geometry::Rig rig;
  std::vector<LensRays> rays;
  std::vector<Image> plates;

  int num_cameras() const { return static_cast<int>(rig.cameras.size()); }
  const std::string& name(int camera_idx) const { return rig.cameras[camera_idx].camera.name; }
  std::string Path(const std::string& relative) const { return folder + "/" + relative; }
};

/// The empty studio; the room with the posters is the larger one, so that it holds every ring of cameras.
RayColor Surroundings(const SynthOptions& options, uint64_t seed) {
  if (options.background == Background::kPosters) {
    TexturedRoom room;
    room.size_m.head<2>() = room.size_m.head<2>().cwiseMax(2 * static_cast<float>(options.radius_m) + 1.5f);
    room.size_m.z() = std::max(room.size_m.z(), static_cast<float>(options.height_m + options.radius_m));
    room.seed = seed;
    return [room](const auto& origin, const auto& direction) { return room.Color(origin, direction); };
  }
  const Room room{options.background == Background::kTextured, seed};
  return [room](const auto& origin, const auto& direction) { return room.Color(origin, direction); };
}

Studio BuildStudio(const SynthOptions& options, const std::string& folder, const RunContext& run) {
  Studio studio{options, run, folder, MakeStudio(options, run.seed), {}, {}};
  ProgressStage stage(run, "empty studio", studio.num_cameras());
  const int threads = ResolveThreads(run.num_threads);
  const RayColor color = Surroundings(options, run.seed);
  for (int c = 0; c < studio.num_cameras(); ++c) {
    studio.rays.emplace_back(studio.rig.cameras[c], threads);
    studio.plates.push_back(RenderPlate(color, studio.rays.back(), 3, threads));
    dataset::WriteImage(studio.plates.back(), studio.Path("raw/plate/" + studio.name(c) + ".png"));
    stage.Advance();
  }
  return studio;
}

std::vector<Recorder> OpenRecorders(const Studio& studio, const std::string& relative) {
  MakeFolder(studio.Path(relative));
  std::vector<Recorder> recorders;
  for (int c = 0; c < studio.num_cameras(); ++c)
    recorders.emplace_back(studio.Path(relative + "/" + studio.name(c)), studio.options);
  return recorders;
}

/// Renders `count` frames in batches, all cameras of a batch in parallel, and encodes them in order. `prepare(first, last)`
/// sets a batch up; `draw(frame, camera, image)` renders over the empty studio.
void Record(const Studio& studio, const std::string& relative, int count, const std::string& stage_name,
            const std::function<void(int, int)>& prepare, const std::function<void(int, int, Image*)>& draw) {
  std::vector<Recorder> recorders = OpenRecorders(studio, relative);
  ProgressStage stage(studio.run, stage_name, count);
  const int threads = ResolveThreads(studio.run.num_threads), cameras = studio.num_cameras();
  for (int first = 0; first < count; first += kBatch) {
    const int last = std::min(count, first + kBatch);
    prepare(first, last);
    std::vector<Image> images(static_cast<size_t>(last - first) * cameras);
    ParallelFor(static_cast<int64_t>(images.size()), threads, [&](int64_t i) {
      const int camera_idx = static_cast<int>(i % cameras), frame_idx = first + static_cast<int>(i / cameras);
      images[i] = studio.plates[camera_idx];
      draw(frame_idx, camera_idx, &images[i]);
    });
    ParallelFor(cameras, threads, [&](int64_t c) {
      for (int f = first; f < last; ++f) recorders[c].Write(images[static_cast<size_t>(f - first) * cameras + c]);
    });
    stage.Advance(last - first);
  }
  for (Recorder& recorder : recorders) recorder.Close();
}

void RecordBoard(const Studio& studio) {
  const calib::Board board = calib::ParseBoard(studio.options.board);
  const BoardPainter painter(board);
  std::vector<geometry::Rigid3> poses;
  for (int f = 0; f < studio.options.board_frames; ++f)
    poses.push_back(BoardPose(board, f, studio.options.board_frames, studio.run.seed));
  const int samples = studio.options.samples + 2;
  Record(
      studio, "raw/board", studio.options.board_frames, "board footage", [](int, int) {},
      [&](int frame_idx, int camera_idx, Image* image) {
        painter.Draw(poses[frame_idx], studio.rig.cameras[camera_idx], studio.rays[camera_idx], samples, image);
      });
  WriteBoardPoses(board, poses, studio.Path("truth/board_poses.json"));
}

/// A frame without a surface.
struct SubjectFailure {
  Status status;
  int frame_idx;
};

/// The person of one take, frame by frame, with the truth that goes with it.
class Take {
 public:
  Take(const Studio& studio, std::string name, Subject* subject)
      : studio_(studio),
        name_(std::move(name)),
        skeleton_(geometry::SkeletonByName("body25")),
        subject_(*subject),
        surface_truth_(studio.Path("truth"), subject_.surface(), subject_.dressed()),
        detections_(studio.num_cameras(), std::vector<dataset::Person2d>(studio.options.all_take_frames())) {
    truth_.skeleton = skeleton_.name;
    for (int c = 0; c < studio_.num_cameras(); ++c) {
      MakeFolder(TruthFolder("masks", c));
      MakeFolder(TruthFolder("partuv", c));
    }
  }

  /// Throws SubjectFailure when the cloth gives no surface.
  void Prepare(int first, int last) {
    first_ = first;
    scenes_.clear();
    scenes_.resize(last - first);
    joints_.resize(last - first);
    const int threads = ResolveThreads(studio_.run.num_threads);
    const Subject::Frames batch = subject_.Next(first, last, threads);
    if (batch.status != Status::kOk) throw SubjectFailure{batch.status, first + static_cast<int>(batch.frames.size())};
    ParallelFor(last - first, threads, [&](int64_t i) {
      joints_[i] = PersonJoints(subject_.naked(), batch.frames[i].pose, skeleton_);
      scenes_[i] = std::make_unique<BodyScene>(subject_.surface(), subject_.textures(), batch.frames[i].vertices,
                                               subject_.dressed() != nullptr);
    });
    for (int f = first; f < last; ++f) {
      const Subject::Frame& frame = batch.frames[f - first];
      AppendTruth(f, skeleton_.joints, joints_[f - first], &truth_);
      surface_truth_.Add(f, frame.pose, frame.vertices, frame.skinned, joints_[f - first]);
    }
  }

  void Draw(int frame_idx, int camera_idx, Image* image) {
    const geometry::RigCamera& camera = studio_.rig.cameras[camera_idx];
    const BodyScene& scene = *scenes_[frame_idx - first_];
    const BodyScene::Truth truth = scene.Draw(camera, studio_.rays[camera_idx], studio_.options.samples, image);
    Image mask(image->width, image->height, 1), part_uv(image->width, image->height, 3);
    for (size_t i = 0; i < truth.part.size(); ++i) {
      mask.pixels[i] = truth.part[i] ? 255 : 0;
      part_uv.pixels[3 * i] = truth.part[i], part_uv.pixels[3 * i + 1] = truth.u[i], part_uv.pixels[3 * i + 2] = truth.v[i];
    }
    dataset::WriteImage(mask, FramePath(TruthFolder("masks", camera_idx), frame_idx));
    dataset::WriteImage(part_uv, FramePath(TruthFolder("partuv", camera_idx), frame_idx));
    const uint64_t seed = studio_.run.seed * 0x100000001b3ull + static_cast<uint64_t>(frame_idx) * 4099 + camera_idx;
    detections_[camera_idx][frame_idx] =
        DetectJoints(scene, camera, skeleton_, joints_[frame_idx - first_], studio_.options.noise_px, seed);
  }

  void WriteJoints() const {
    dataset::Pose3d truth = truth_;
    truth.frame_rate_hz = studio_.options.fps;
    dataset::WritePose3d(truth, studio_.Path("truth/pose3d"));
    surface_truth_.Finish(skeleton_, studio_.options.fps);
    for (int c = 0; c < studio_.num_cameras(); ++c) {
      dataset::Pose2dTrack track{studio_.name(c), {}};
      for (size_t f = 0; f < detections_[c].size(); ++f) track.frames[static_cast<int>(f)] = {detections_[c][f]};
      dataset::WriteOpenPoseFolder(track, studio_.Path("pose2d/" + name_ + "/" + studio_.name(c)));
    }
  }

  /// Empty for a subject that skinning explains.
  std::vector<BeyondSkinning> beyond_skinning() const {
    return subject_.dressed() ? surface_truth_.beyond_skinning() : std::vector<BeyondSkinning>();
  }

 private:
  std::string TruthFolder(const std::string& kind, int camera_idx) const {
    return studio_.Path("truth/" + kind + "/" + name_ + "/" + studio_.name(camera_idx));
  }

  const Studio& studio_;
  const std::string name_;
  const geometry::Skeleton& skeleton_;
  Subject& subject_;
  SurfaceTruth surface_truth_;
  std::vector<std::vector<dataset::Person2d>> detections_;  // [camera][frame]
  dataset::Pose3d truth_;
  int first_ = 0;
  std::vector<Eigen::Matrix3Xd> joints_;            // of the batch
  std::vector<std::unique_ptr<BodyScene>> scenes_;  // of the batch
};

void RecordTake(const Studio& studio, Subject* subject, SynthSummary* summary) {
  Take take(studio, "take1", subject);
  Record(
      studio, "raw/take1", studio.options.all_take_frames(), "person footage",
      [&](int first, int last) { take.Prepare(first, last); },
      [&](int frame_idx, int camera_idx, Image* image) { take.Draw(frame_idx, camera_idx, image); });
  take.WriteJoints();
  summary->beyond_skinning = take.beyond_skinning();
}

void Summarise(const SynthOptions& options, int cameras, SynthSummary* summary) {
  summary->cameras = cameras;
  summary->frames = options.board_frames + options.all_take_frames();
  const auto [width, height] = ParseSize(options.size);
  summary->pixels = static_cast<int64_t>(width) * height * cameras * (summary->frames + 1);
  std::vector<std::string>& files = summary->files;
  files = {"mvstudio.toml", "truth/calibration.json", "raw/plate"};
  if (options.board_frames > 0) files.insert(files.end(), {"raw/board", "truth/board_poses.json"});
  if (options.take_frames > 0)
    files.insert(files.end(), {"raw/take1", "pose2d/take1", "truth/pose3d", "truth/masks/take1", "truth/partuv/take1",
                               "truth/subject_rest.npz", "truth/motion.npz"});
}

}  // namespace

SynthSummary WriteSession(const SynthOptions& options, const std::string& folder, bool overwrite, const RunContext& run) {
  Validate(options);
  AtomicFolder output(folder, overwrite, options.body.empty() ? std::vector<std::string>() : std::vector{options.body});
  std::unique_ptr<Subject> subject;  // before anything is rendered: a body that is refused costs no work
  if (options.take_frames > 0) subject = std::make_unique<Subject>(options, run.seed);
  const Studio studio = BuildStudio(options, output.work_path(), run);
  geometry::WriteRig(studio.rig, studio.Path("truth/calibration.json"));
  if (options.board_frames > 0) RecordBoard(studio);
  SynthSummary summary;
  try {
    if (subject) RecordTake(studio, subject.get(), &summary);
  } catch (const SubjectFailure& failure) {
    summary.status = failure.status, summary.failed_frame = failure.frame_idx;
    return summary;
  }
  WriteSessionToml(options, studio.rig, studio.Path("mvstudio.toml"));
  output.Commit();
  Summarise(options, studio.num_cameras(), &summary);
  return summary;
}

}  // namespace mvstudio::synth
