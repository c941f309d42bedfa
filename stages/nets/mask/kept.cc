#include "stages/nets/mask/kept.h"

#include "core/disk/kept_key.h"
#include "core/join.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::stages {
namespace {

using dataset::ColourMixture;
using dataset::ProjectedBody;

/// To be raised whenever sampling, learning, segmenting or a layout gives other results than before.
constexpr char kMasksVersion[] = "mvstudio masks 1";

void PutPoint(const Eigen::Vector2d& point, KeptWriter* out) { out->Put<double>(point.x()), out->Put<double>(point.y()); }

void PutBody(const ProjectedBody& body, KeptWriter* out) {
  out->Put<uint64_t>(body.limbs.size()), out->Put<uint64_t>(body.bones.size());
  for (const dataset::BodyCapsule& limb : body.limbs) {
    PutPoint(limb.a_px, out), PutPoint(limb.b_px, out);
    for (const double value : {limb.radius_a_px, limb.radius_b_px, limb.px_per_m}) out->Put<double>(value);
  }
  for (const auto& [a_px, b_px] : body.bones) PutPoint(a_px, out), PutPoint(b_px, out);
  for (const Eigen::Vector2d& joint_px : body.joints_px) PutPoint(joint_px, out);
}

void AddBodies(const dataset::BodiesOfTake& bodies, KeptKey* key) {
  for (const auto& [frame, body] : bodies.frames) {
    KeptWriter out;
    out.Put<int32_t>(frame);
    PutBody(body, &out);
    key->Add(out.Take());
  }
}

void AddPeople3d(const std::map<int, People>& poses, KeptKey* key) {
  for (const auto& [step, people] : poses) {
    KeptWriter out;
    out.Put<int32_t>(step);
    for (const auto& [person, pose] : people) {
      out.Put<int32_t>(person);
      out.PutAll(pose.x_in_world.data(), static_cast<size_t>(pose.x_in_world.size()));
      for (const bool valid : pose.valid) out.Put<uint8_t>(valid ? 1 : 0);
    }
    key->Add(out.Take());
  }
}

std::string DigestOfImage(const Image& image) {
  KeptWriter out;
  PutImage(image, &out);
  return out.Take();
}

void PutMixture(const ColourMixture& mixture, KeptWriter* out) {
  out->Put<uint64_t>(mixture.components.size());
  for (const ColourMixture::Component& component : mixture.components) {
    out->Put<double>(component.log_weight), out->Put<double>(component.log_norm);
    out->PutAll(component.mean.data(), 3), out->PutAll(component.whitening.data(), 9);
  }
}

template <size_t kCount>
void GetDoubles(KeptReader* in, double* to) {
  const std::vector<double> values = in->All<double>();
  if (values.size() != kCount) throw DamagedBytes();
  std::copy(values.begin(), values.end(), to);
}

ColourMixture GetMixture(KeptReader* in) {
  ColourMixture mixture;
  mixture.components.resize(in->Count(1));
  for (ColourMixture::Component& component : mixture.components) {
    component.log_weight = in->Get<double>(), component.log_norm = in->Get<double>();
    GetDoubles<3>(in, component.mean.data()), GetDoubles<9>(in, component.whitening.data());
  }
  return mixture;
}

void RequireEnd(const KeptReader& in) {
  if (!in.AtEnd()) throw DamagedBytes();
}

}  // namespace

std::string SamplesKey(const CachePlace& cache, const dataset::CameraFootage& footage, const dataset::MaskOptions& options,
                       bool keep_undamaged) {
  if (!KeptResults(cache, kSamplesKind).enabled()) return "";
  const std::optional<std::string> content = FootageDigest(cache, footage.path);
  if (!content) return "";
  KeptKey key;
  key.Add(kMasksVersion);
  key.Add(*content);
  key.Add(std::to_string(options.background_frames) + (keep_undamaged ? " undamaged" : ""));
  return key.Take();
}

std::string ModelKey(const MaskJob& job, const MaskCamera& camera, const MaskBackend& backend) {
  if (camera.samples_key.empty() || (backend.net && backend.weights.empty())) return "";
  KeptKey key;
  key.Add(camera.samples_key);
  key.Add(backend.name + " " + backend.weights);
  key.AddFields(job.mask);
  key.Add(DigestOfImage(camera.plate));
  AddBodies(camera.bodies, &key);
  return key.Take();
}

std::string MasksKey(const MaskJob& job, const MaskCamera& camera, const MaskBackend& backend, const std::string& room) {
  const std::string model = ModelKey(job, camera, backend);
  if (model.empty()) return "";
  KeptKey key;
  key.Add(model);
  key.Add(room);
  key.Add(std::to_string(job.run.sheet_tiles) + (job.run.soft ? " soft" : ""));
  if (camera.wanted) key.Add(Join(*camera.wanted, " ", [](int frame) { return std::to_string(frame); }));
  return key.Take();
}

std::string RoomKey(const MaskJob& job, const MaskBackend& backend) {
  KeptKey key;
  geometry::Rig rig;
  for (const MaskCamera& camera : job.cameras) {
    const std::string masks = MasksKey(job, camera, backend, "");
    if (masks.empty() || !camera.camera) return "";
    key.Add(masks);
    if (camera.frame_at)
      key.Add(Join(*camera.frame_at, " ",
                   [](const auto& at) { return std::to_string(at.first) + ":" + std::to_string(at.second); }));
    rig.cameras.push_back(*camera.camera);
  }
  key.Add(geometry::RigToJsonText(rig));
  key.AddFields(job.hull);
  AddPeople3d(job.poses, &key);
  return key.Take();
}

std::string MaskChoiceKey(const MaskStageOptions& options, const TakeInput& take, const std::vector<MaskBackend>& backends) {
  if (!options.pose2d.empty() || !KeptResults(options.cache, kChoiceOfMasksKind).enabled()) return "";
  KeptKey key;
  for (const dataset::CameraFootage& footage : take.footage) {
    const std::string samples = SamplesKey(options.cache, footage, options.mask, options.run.keep_undamaged);
    if (samples.empty()) return "";
    key.Add(footage.camera + " " + samples);
    if (!footage.plate.empty()) key.Add(FootageDigest(options.cache, footage.plate).value_or(""));
    const dataset::CameraTimeline* times = footage.timeline ? footage.timeline->Find(footage.camera) : nullptr;
    if (times) key.Add(Join(times->frame_at, " ", [](int64_t frame) { return std::to_string(frame); }));
  }
  for (const MaskBackend& backend : backends) {
    if (backend.net && backend.weights.empty()) return "";
    key.Add(backend.name + " " + backend.weights);
  }
  const std::string calibration = options.calib.empty() ? take.calibration : options.calib;
  for (const std::string& path : {calibration, options.pose3d})
    key.Add(path.empty() ? "" : FootageDigest(options.cache, path).value_or(""));
  key.Add(options.marker_unit + (options.read.invert ? " invert" : "") + (options.read.mirror ? " mirror" : ""));
  key.Add(Join(options.changes.first_frame, " ", [](const CameraValue& value) { return ToString(value); }));
  key.Add(options.changes.frames);
  MaskRunOptions run = options.run;
  run.overwrite = false;
  key.AddFields(run), key.AddFields(options.mask), key.AddFields(options.hull);
  return key.Take();
}

std::string EncodeSamples(const dataset::FootageSamples& samples) {
  KeptWriter out;
  for (const int n : {samples.num_frames, samples.width, samples.height}) out.Put<int32_t>(n);
  out.PutAll(samples.numbers.data(), samples.numbers.size()), out.PutAll(samples.all.data(), samples.all.size());
  out.Put<uint64_t>(samples.damage.size());
  for (const std::string& line : samples.damage) out.Put(line);
  out.Put<uint64_t>(samples.frames.size());
  for (const Image& frame : samples.frames) PutImage(frame, &out);
  return out.Take();
}

dataset::FootageSamples DecodeSamples(const std::string& bytes) {
  KeptReader in(bytes);
  dataset::FootageSamples samples;
  for (int* n : {&samples.num_frames, &samples.width, &samples.height}) *n = in.Get<int32_t>();
  samples.numbers = in.All<int>(), samples.all = in.All<int>();
  for (uint64_t n = in.Count(1); n > 0; --n) samples.damage.push_back(in.Text());
  for (uint64_t n = in.Count(1); n > 0; --n) samples.frames.push_back(GetImage(&in));
  RequireEnd(in);
  return samples;
}

std::string EncodeLearned(const dataset::LearnedCamera& learned) {
  KeptWriter out;
  out.Put<int32_t>(static_cast<int32_t>(learned.status));
  const dataset::BackgroundModel& background = learned.model.background;
  PutImage(background.colour, &out);
  out.PutAll(background.sigma.data(), background.sigma.size()), out.PutAll(background.known.data(), background.known.size());
  PutMixture(learned.model.person, &out), PutMixture(learned.model.surroundings, &out);
  return out.Take();
}

dataset::LearnedCamera DecodeLearned(const std::string& bytes) {
  KeptReader in(bytes);
  dataset::LearnedCamera learned;
  learned.status = static_cast<Status>(in.Get<int32_t>());
  dataset::BackgroundModel& background = learned.model.background;
  background.colour = GetImage(&in);
  background.sigma = in.All<float>(), background.known = in.All<uint8_t>();
  learned.model.person = GetMixture(&in), learned.model.surroundings = GetMixture(&in);
  RequireEnd(in);
  return learned;
}

std::string EncodeMaskBlock(const MaskBlock& block) {
  KeptWriter out;
  const dataset::TakeMasks& take = block.take;
  out.Put<int64_t>(block.positions);
  for (const int n : {take.images, take.empty, take.joints, take.joints_on_mask, take.joints_supported}) out.Put<int32_t>(n);
  for (const double value : {take.area_fraction_sum, take.seconds, take.flicker.unmoving_px, take.flicker.changed_px})
    out.Put<double>(value);
  out.Put<uint64_t>(block.frames.size());
  for (const MaskBlock::Frame& frame : block.frames) {
    out.Put<int32_t>(frame.number);
    out.Put(frame.mask), out.Put(frame.soft);
    PutImage(frame.tile, &out);
  }
  return out.Take();
}

MaskBlock DecodeMaskBlock(const std::string& bytes) {
  KeptReader in(bytes);
  MaskBlock block;
  dataset::TakeMasks& take = block.take;
  block.positions = in.Get<int64_t>();
  for (int* n : {&take.images, &take.empty, &take.joints, &take.joints_on_mask, &take.joints_supported}) *n = in.Get<int32_t>();
  for (double* value : {&take.area_fraction_sum, &take.seconds, &take.flicker.unmoving_px, &take.flicker.changed_px})
    *value = in.Get<double>();
  block.frames.resize(in.Count(1));
  for (MaskBlock::Frame& frame : block.frames) {
    frame.number = in.Get<int32_t>();
    frame.mask = in.Text(), frame.soft = in.Text();
    frame.tile = GetImage(&in);
  }
  RequireEnd(in);
  return block;
}

std::string EncodeMaskTrials(const std::vector<MaskTrial>& trials) {
  KeptWriter out;
  out.Put<uint64_t>(trials.size());
  for (const MaskTrial& trial : trials) {
    out.Put(trial.name), out.Put(trial.failed_camera);
    out.Put<int32_t>(static_cast<int32_t>(trial.status));
    out.Put<double>(trial.disagreement), out.Put<double>(trial.joints_supported);
  }
  return out.Take();
}

std::vector<MaskTrial> DecodeMaskTrials(const std::string& bytes) {
  KeptReader in(bytes);
  std::vector<MaskTrial> trials(in.Count(1));
  for (MaskTrial& trial : trials) {
    trial.name = in.Text(), trial.failed_camera = in.Text();
    trial.status = static_cast<Status>(in.Get<int32_t>());
    trial.disagreement = in.Get<double>(), trial.joints_supported = in.Get<double>();
  }
  RequireEnd(in);
  return trials;
}

void ForgetMasks(const MaskJob& job, const std::vector<MaskBackend>& backends, const std::string& choice) {
  const auto forget = [&](const char* kind, const std::string& key) {
    if (!key.empty()) KeptResults(job.cache, kind).Remove(key);
  };
  forget(kChoiceOfMasksKind, choice);
  for (const MaskBackend& backend : backends) {
    const std::string room = job.run.hull ? RoomKey(job, backend) : "";
    for (const MaskCamera& camera : job.cameras) {
      forget(kModelsKind, ModelKey(job, camera, backend));
      forget(kMasksKind, MasksKey(job, camera, backend, ""));
      if (!room.empty()) forget(kMasksKind, MasksKey(job, camera, backend, room));
    }
  }
  for (const MaskCamera& camera : job.cameras) forget(kSamplesKind, camera.samples_key);
}

}  // namespace mvstudio::stages
