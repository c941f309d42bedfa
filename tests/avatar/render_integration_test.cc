#include <ATen/ATen.h>

#include "avatar/maps/template_maps.h"
#include "avatar/nets/sequence.h"
#include "avatar/run/render/backdrop.h"
#include "avatar/run/render/render.h"
#include "avatar/scores/image_scores.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/units.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

/// A dataset of 5 cameras and 6 frames and an untrained avatar with random textures for it.
class RenderRun : public ::testing::Test {
 protected:
  RenderRun() : folder_("render") {
    WriteMannequinDataset(dataset(), 5, 6, 128);
    data_ = dataset::OpenPanopticDataset(dataset());
    config_.dataset = dataset();
    config_.pack.size_px = 64;
    config_.pack.person = 0;
    config_.half_extent_m = config_.pack.half_extent_m = 1.2;
    config_.split = SplitDataset(data_, 0, {"00_01", "00_03"}, {4, 5});
  }
  std::string dataset() const { return folder_.path() + "/dataset"; }

  static AvatarModel Model(const std::string& method, const std::string& prior = "none") {
    ModelOptions options;
    FromString(method, &options.method);
    FromString(prior, &options.prior);
    options.template_colours = method == "direct";
    options.width = 4, options.downs = 2, options.encoder_blocks = options.decoder_blocks = 1, options.texture_px = 8;
    AvatarModel model = MakeModel(options, 64, {-0.5, 0.5}, 1);
    at::manual_seed(3);
    if (model.textures.defined()) model.textures = at::rand_like(model.textures.detach());
    // Untrained heads are flat: enlarge them so that all opacities occur.
    for (at::Tensor& parameter : model.generator->parameters()) parameter.data().mul_(3);
    return model;
  }

  std::map<std::string, Image> RenderAll(AvatarModel& model, const RenderOptions& options) const {
    std::map<std::string, Image> images;
    RenderImages(model, config_, MakeRenderPlan(config_, data_, options), options, {},
                 [&](const RenderJob& job, const Image& image) { images[job.view + " " + std::to_string(job.frame)] = image; });
    return images;
  }

  /// The dataset's person with colours of its own.
  static std::shared_ptr<const body::TexturedPerson> Mannequin() {
    body::TexturedPerson person;
    person.person.body = body::MakeMannequin(1.75, 0.5);
    person.textures = body::MannequinTextures(16, 1);
    return std::make_shared<const body::TexturedPerson>(person);
  }

  /// The dataset's joints scaled about `about`, as a folder of body3DScene files.
  std::string ScaledPoses(double factor, const Eigen::Vector3d& about) const {
    const std::string out = folder_.path() + "/scaled_" + std::to_string(factor) + "_" + std::to_string(about.x());
    MakeFolder(out);
    for (const auto& [frame, people] : data_.poses) {
      dataset::Coco19Pose pose = people.at(0);
      pose.x_in_world = (factor * (pose.x_in_world.colwise() - about)).colwise() + about;
      dataset::WriteBody3dScene({{0, pose}}, 0, out + Format("/body3DScene_%08d.json", frame));
    }
    return out;
  }

  TemporaryFolder folder_;
  dataset::PanopticDataset data_;
  RunConfig config_;
};

int LargestDifference(const Image& a, const Image& b) {
  if (a.pixels.size() != b.pixels.size()) return 1000;
  int largest = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) largest = std::max(largest, std::abs(a.pixels[i] - b.pixels[i]));
  return largest;
}

int Contrast(const Image& image) {
  const auto [low, high] = std::minmax_element(image.pixels.begin(), image.pixels.end());
  return *high - *low;
}

using MethodAndPrior = std::pair<const char*, const char*>;
class RenderMethods : public RenderRun, public ::testing::WithParamInterface<MethodAndPrior> {};

TEST_P(RenderMethods, ADatasetsCameraGivesTheImageThatEvaluationScores) {
  AvatarModel model = Model(GetParam().first, GetParam().second);
  config_.pack.template_input_px = model.options.prior == Prior::kTemplate ? 64 : 0;
  config_.pack.fit_shape = false;
  if (CorrectsColours(model.options)) config_.pack.fitted = Mannequin(), config_.pack.template_colours = true;
  TrainingSetOptions crop = config_.pack;
  crop.template_maps = false;
  crop.cameras = {"00_00", "00_03"}, crop.frames = {2, 3, 4};  // trained and held out
  const AvatarPack pack = BuildTrainingSet(data_, crop, {}).pack;
  const RenderedPack scored = RenderPack(model, pack, 8);
  const at::Tensor levels = (EightBit(scored.images) * 255).round().to(at::kByte);
  RenderOptions options;
  options.cameras = "00_00,00_03", options.frames = {2, 3, 4};
  const auto images = RenderAll(model, options);
  ASSERT_EQ(images.size(), 6u);
  for (int64_t i = 0; i < pack.size(); ++i) {
    const std::string name =
        pack.cameras[pack.camera_idx[i].item<int64_t>()] + " " + std::to_string(pack.frame[i].item<int64_t>());
    const Image image = Backdrop("black").Under(images.at(name));
    EXPECT_GT(Contrast(image), 40) << "something is to be seen";
    const at::Tensor truth = levels[i].permute({1, 2, 0}).contiguous();
    int largest = 0;
    for (size_t k = 0; k < image.pixels.size(); ++k)
      largest = std::max(largest, std::abs(image.pixels[k] - truth.data_ptr<uint8_t>()[k]));
    EXPECT_LE(largest, 1) << name;
  }
}
INSTANTIATE_TEST_SUITE_P(All, RenderMethods,
                         ::testing::Values(MethodAndPrior("tna", "none"), MethodAndPrior("direct", "none"),
                                           MethodAndPrior("v2v", "none"), MethodAndPrior("tna", "template"),
                                           MethodAndPrior("direct", "template"), MethodAndPrior("v2v", "template")));

TEST_F(RenderRun, AfterAGapAMethodWithMemoryBeginsAnew) {
  AvatarModel model = Model("v2v");
  RenderOptions options;
  options.cameras = "00_00", options.frames = {1, 2, 4, 5};
  const auto gap = RenderAll(model, options);
  options.frames = {4, 5};
  const auto fresh = RenderAll(model, options);
  options.frames = {1, 2, 3, 4, 5};
  const auto straight = RenderAll(model, options);
  EXPECT_EQ(LargestDifference(gap.at("00_00 5"), fresh.at("00_00 5")), 0);
  EXPECT_EQ(LargestDifference(gap.at("00_00 2"), straight.at("00_00 2")), 0);
  EXPECT_GT(LargestDifference(straight.at("00_00 5"), fresh.at("00_00 5")), 1) << "the past matters";
}

TEST_F(RenderRun, APoseThatTheTemplateCannotTakeIsLeftOutWithTheReason) {
  config_.pack.template_input_px = 64;
  for (const int hip : {2, 6, 12}) data_.poses.at(4).at(0).valid[hip] = false;
  RenderOptions options;
  options.cameras = "00_03", options.frames = {4, 5};
  const RenderPlan plan = MakeRenderPlan(config_, data_, options);
  ASSERT_EQ(plan.jobs.size(), 1u);
  EXPECT_EQ(plan.jobs[0].frame, 5);
  ASSERT_EQ(plan.skipped.size(), 1u);
  EXPECT_THAT(plan.skipped[0], AllOf(HasSubstr("frame 4"), HasSubstr("trunk")));
}

TEST_F(RenderRun, BackdropsAreTheRenderersOwnBackground) {
  AvatarModel model = Model("tna");
  RenderOptions options;
  options.cameras = "00_03", options.frames = {4};
  const RenderPlan plan = MakeRenderPlan(config_, data_, options);
  ASSERT_EQ(plan.jobs.size(), 1u);
  AvatarPack pose;
  pose.joints_in_cam = at::zeros({1, kNumJoints, 3}), pose.joint_valid = at::zeros({1, kNumJoints}, at::kBool),
  pose.intrinsics = at::zeros({1, 4});
  FillPose(pose, 0, plan.joints[0], plan.jobs[0].crop);
  const at::Tensor colour = at::tensor({10.0f / 255, 200.0f / 255, 30.0f / 255});
  const Rendering r = Render(model, PosesOf(pose), 64, 64, colour);
  EXPECT_LT(CleanAlpha(r.mask_prob).min().item<double>(), 0.9);
  EXPECT_GT(CleanAlpha(r.mask_prob).max().item<double>(), 0.1);
  const at::Tensor expected = (r.image[0] * 255).round().permute({1, 2, 0}).to(at::kByte).contiguous();
  const Image got = Backdrop("10,200,30").Under(RenderAll(model, options).begin()->second);
  for (size_t k = 0; k < got.pixels.size(); ++k) ASSERT_NEAR(got.pixels[k], expected.data_ptr<uint8_t>()[k], 1) << k;
}

TEST_F(RenderRun, PeopleOfAnySizeGiveTheImageOfTheTrainedOne) {
  AvatarModel model = Model("tna");
  RenderOptions options;
  options.cameras = "00_01,00_02", options.frames = {1, 5};
  options.poses = ScaledPoses(1, {0, 0, 0});
  const auto unscaled = RenderAll(model, options);
  options.poses.clear();
  const auto own = RenderAll(model, options);
  for (const auto& [name, image] : own)
    EXPECT_LE(LargestDifference(image, unscaled.at(name)), 2) << "the median of bones that keep their lengths";
  for (const double factor : {0.7, 1.4}) {
    options.poses = ScaledPoses(factor, {0, 0, 0});
    options.scale_normalise = ScaleNormalise::kOn, options.place = RenderPlace::kKeep;
    for (const auto& [name, image] : RenderAll(model, options))
      EXPECT_LE(LargestDifference(image, unscaled.at(name)), 1) << factor << name;
    options.scale_normalise = ScaleNormalise::kOff;
    for (const auto& [name, image] : RenderAll(model, options))
      EXPECT_GT(LargestDifference(image, unscaled.at(name)), 20) << "without it the picture is another one: " << name;
    options.scale_normalise = ScaleNormalise::kOn, options.place = RenderPlace::kTraining;
    options.poses = ScaledPoses(1, {0, 0, 0});
    const auto placed = RenderAll(model, options);
    options.poses = ScaledPoses(factor, {0.8, -0.5, 0.3});
    for (const auto& [name, image] : RenderAll(model, options))
      EXPECT_LE(LargestDifference(image, placed.at(name)), 1) << "wherever the small person stood: " << factor << name;
  }
}

TEST_F(RenderRun, SizesAndWholeImages) {
  AvatarModel model = Model("tna");
  RenderOptions options;
  options.cameras = "00_03", options.frames = {4};
  const Image small = RenderAll(model, options).begin()->second;
  options.size_px = 128;
  const Image large = RenderAll(model, options).begin()->second;
  ASSERT_EQ(large.width, 128);
  for (int k = 0; k < 4; ++k) {  // the mean stays
    double a = 0, b = 0;
    for (size_t p = static_cast<size_t>(k); p < small.pixels.size(); p += 4) a += small.pixels[p];
    for (size_t p = static_cast<size_t>(k); p < large.pixels.size(); p += 4) b += large.pixels[p];
    EXPECT_NEAR(4 * a, b, 0.01 * b) << k;
  }
  options.size_px = 0, options.frame = RenderFrame::kCamera;
  const RenderPlan plan = MakeRenderPlan(config_, data_, options);
  const Image whole = RenderAll(model, options).begin()->second;
  ASSERT_EQ(whole.width, 128) << "the camera's own size";
  // The middle of the crop lands where the camera projects the point on the crop's axis.
  const geometry::RigCamera& camera = plan.jobs[0].camera;
  const Eigen::Vector3d axis_in_world = geometry::Inverse(plan.jobs[0].crop.cam_from_world) * Eigen::Vector3d(0, 0, 3);
  const Eigen::Vector2d px = geometry::Project(camera.camera, camera.cam_from_world * axis_in_world).px;
  const uint8_t* got = whole.Pixel(static_cast<int>(std::lround(px.x())), static_cast<int>(std::lround(px.y())));
  double nearest = 1000;
  for (int dy = -3; dy <= 3; ++dy) {
    for (int dx = -3; dx <= 3; ++dx) nearest = std::min(nearest, std::abs(1.0 * small.Pixel(32 + dx, 32 + dy)[3] - got[3]));
  }
  EXPECT_LT(nearest, 20);
  options.network_size_px = 66;
  EXPECT_THAT(MessageOf<UsageError>([&] { RenderAll(model, options); }),
              AllOf(HasSubstr("option 'network-size'"), HasSubstr("66")));
}

TEST_F(RenderRun, ATurntableLooksAtThePersonFromAllSides) {
  RenderOptions options;
  options.turntable = 8, options.frames = {2}, options.elevation_deg = 15;
  const RenderPlan plan = MakeRenderPlan(config_, data_, options);
  ASSERT_EQ(plan.jobs.size(), 8u);
  for (int k = 0; k < 8; ++k) {
    const RenderJob& job = plan.jobs[k];
    EXPECT_EQ(job.pose, 0u);
    const Eigen::Vector3d a = job.camera.CenterInWorld(), b = plan.jobs[(k + 4) % 8].camera.CenterInWorld();
    EXPECT_NEAR(a.z(), b.z(), 1e-9);
    const Eigen::Vector3d middle = (a + b) / 2;
    const Eigen::Vector2d out = (a - middle).head<2>();
    EXPECT_NEAR(std::atan2(a.z() - plan.track.poses[0].x_in_world.row(2).minCoeff() -
                               0.5 * (plan.track.poses[0].x_in_world.row(2).maxCoeff() -
                                      plan.track.poses[0].x_in_world.row(2).minCoeff()),
                           out.norm()),
                DegToRad(15), 1e-9);
    EXPECT_NEAR(job.crop.camera.cx(), 31.5, 1e-12);
  }
  options.frames = {0, 1, 2, 3};
  EXPECT_EQ(MakeRenderPlan(config_, data_, options).jobs[5].pose, 2u) << "the motion is spread over the turn";
  options.cameras = "00_01";
  EXPECT_THROW(MakeRenderPlan(config_, data_, options), UsageError);
}

TEST_F(RenderRun, WrongRequestsAreNamed) {
  const auto message = [&](auto change) {
    return MessageOf<UsageError>([&] {
      RenderOptions options;
      change(options);
      MakeRenderPlan(config_, data_, options);
    });
  };
  EXPECT_THAT(message([](RenderOptions& o) { o.cameras = "cam_77"; }), AllOf(HasSubstr("cam_77"), HasSubstr("00_04")));
  EXPECT_THAT(message([](RenderOptions& o) { o.frames = {99}; }), HasSubstr("frame 99"));
  EXPECT_THAT(message([](RenderOptions& o) { FromString("yes", &o.scale_normalise); }), HasSubstr("option 'scale-normalise'"));
  EXPECT_THAT(message([](RenderOptions& o) { o.poses = "a", o.bvh = "b"; }), HasSubstr("option 'bvh'"));
  RenderOptions usual;
  const RenderPlan plan = MakeRenderPlan(config_, data_, usual);
  EXPECT_EQ(plan.jobs.size(), 4u) << "held-out cameras in held-out frames";
  EXPECT_EQ(plan.jobs[0].view, "00_01");
  EXPECT_EQ(plan.jobs[0].frame, 4);
}

TEST_F(RenderRun, ACalibrationOfOthersIsRendered) {
  geometry::Rig rig;
  rig.cameras = {RingCamera(7, 9, 96)};
  const std::string path = folder_.path() + "/calibration_other.json";
  dataset::WritePanopticCalibration(rig, path, "test");
  RenderOptions options;
  options.calib = path, options.frames = {1};
  const RenderPlan plan = MakeRenderPlan(config_, data_, options);
  ASSERT_EQ(plan.jobs.size(), 1u);
  EXPECT_EQ(plan.jobs[0].view, "00_07");
  EXPECT_NEAR((plan.jobs[0].crop.CenterInWorld() - rig.cameras[0].CenterInWorld()).norm(), 0, 1e-6);
}

}  // namespace
}  // namespace mvstudio::avatar
