#include "avatar/splats/train/train.h"

#include <cmath>
#include <limits>

#include "avatar/body/texture/bake.h"
#include "avatar/splats/train/initial.h"
#include "avatar/splats/train/train_step.h"
#include "core/error.h"
#include "tests/splats/scenes.h"
#include "tests/support/test.h"

namespace mvstudio::splats {
namespace {

/// A small body, its true colours, and others to begin with.
struct Person {
  body::BodyTemplate body = body::MakeMannequin(1.75, 0.3);
  body::Textures textures, grey;

  Person() {
    for (Image& chart : grey) chart = Image(8, 8, 3, 128);
    for (int part = 0; part < body::kNumParts; ++part) {
      Image& chart = textures[static_cast<size_t>(part)] = Image(24, 24, 3);
      for (int y = 0; y < 24; ++y)
        for (int x = 0; x < 24; ++x)
          for (int c = 0; c < 3; ++c)
            chart.Pixel(x, y)[c] = static_cast<uint8_t>(128 + 90 * std::sin(0.15 * x * (c + 1) + 0.2 * y + part));
    }
  }
};

const Person& ThePerson() {
  static const Person person;
  return person;
}

/// The person at rest from around, rendered.
std::vector<TrainView> Views(int count, int size_px, double first_rad = 0) {
  const Person& p = ThePerson();
  const auto vertices = std::make_shared<const Eigen::Matrix3Xf>(p.body.vertices);
  std::vector<TrainView> views;
  for (int k = 0; k < count; ++k) {
    TrainView view;
    view.camera = testing::CameraOf(size_px, size_px, 1.5 * size_px);
    const double azimuth = first_rad + 2 * 3.14159265358979 * k / count;
    Eigen::Matrix3d cam_from_world;
    cam_from_world << -std::sin(azimuth), std::cos(azimuth), 0, 0, 0, -1, -std::cos(azimuth), -std::sin(azimuth), 0;
    const Eigen::Vector3d center(3 * std::cos(azimuth), 3 * std::sin(azimuth), 0.9);
    view.camera.cam_from_world = {Eigen::Quaterniond(cam_from_world), -cam_from_world * center};
    const body::RenderedBody rendered = body::RenderBody(p.body, p.textures, p.body.vertices, view.camera);
    view.image = rendered.image, view.mask = rendered.cover;
    for (uint8_t& value : view.mask.pixels) value = value >= 128 ? 255 : 0;
    view.vertices = vertices;
    view.name = "camera " + std::to_string(k);
    views.push_back(view);
  }
  return views;
}

TrainOptions FewSteps(int steps) {
  TrainOptions options;
  options.steps = steps, options.check_every = std::max(1, steps / 3), options.count = 2500;
  return options;
}

TEST(Train, BeginsAboutAtTheTexturedBody) {
  const Person& p = ThePerson();
  const std::vector<TrainView> views = Views(3, 64);
  Cloud cloud = CoverBody(p.body, p.textures, 5000, 0, 1);
  const ViewScores own = ScoreViews(cloud, p.body, views, true, {});
  const ViewScores grey = ScoreViews(CoverBody(p.body, p.grey, 5000, 0, 1), p.body, views, true, {});
  for (size_t i = 0; i < views.size(); ++i) {
    EXPECT_GT(own.ssim[i], grey.ssim[i] + 0.05);
    EXPECT_GT(own.ssim[i], 0.75);
    EXPECT_GT(own.psnr_db[i], grey.psnr_db[i] + 2);
  }
}

TEST(Train, LearnsTheColoursOfARenderedBody) {
  const Person& p = ThePerson();
  const std::vector<TrainView> views = Views(6, 96), others = Views(3, 96, 0.5);
  TrainOptions options = FewSteps(300);
  options.count = 8000, options.rates.colour = 0.04;  // far from grey in few steps
  const TrainResult result = TrainCloud(p.body, p.grey, views, {}, options, {});
  ASSERT_EQ(result.status, Status::kOk);
  EXPECT_EQ(result.best_step, 300);
  const ViewScores seen = ScoreViews(result.cloud, p.body, views, true, {}),
                   unseen = ScoreViews(result.cloud, p.body, others, true, {});
  for (const double psnr_db : seen.psnr_db) EXPECT_GT(psnr_db, 30);
  const ViewScores start = ScoreViews(CoverBody(p.body, p.grey, 8000, 0, 1), p.body, others, true, {});
  for (size_t i = 0; i < others.size(); ++i) EXPECT_GT(unseen.psnr_db[i], start.psnr_db[i] + 3);
  EXPECT_LT(result.rows.back().loss.total, 0.5 * result.rows[1].loss.total);
  EXPECT_GT(result.density.cloned + result.density.split, 100);
  EXPECT_EQ(result.rows.back().gaussians, static_cast<int64_t>(result.cloud.size()));
}

TEST(Train, SameSeedSameBytesWithAnyNumberOfThreads) {
  const Person& p = ThePerson();
  const std::vector<TrainView> views = Views(4, 32);
  const auto train = [&](int threads, uint64_t seed) {
    RunContext run;
    run.num_threads = threads, run.seed = seed;
    return TrainCloud(p.body, p.textures, views, {views[0]}, FewSteps(60), run).cloud;
  };
  const Cloud one = train(1, 1), two = train(2, 1), five = train(5, 1), other = train(1, 2);
  for (const Cloud* many : {&two, &five}) {
    EXPECT_EQ(many->face, one.face);
    EXPECT_EQ(many->values.colour, one.values.colour);
    EXPECT_EQ(many->values.rotation, one.values.rotation);
    EXPECT_EQ(many->filter_variance, one.filter_variance);
  }
  EXPECT_NE(other.values.colour, one.values.colour);
}

TEST(Train, ValidationImagesChooseWhatIsKept) {
  const Person& p = ThePerson();
  std::vector<TrainView> views = Views(3, 32), wrong = views;
  for (TrainView& view : wrong)
    for (uint8_t& value : view.image.pixels) value = static_cast<uint8_t>(255 - value);
  const TrainResult result = TrainCloud(p.body, p.textures, wrong, views, FewSteps(90), {});
  ASSERT_EQ(result.rows.size(), 4u);
  size_t best = 0;
  for (size_t k = 1; k < 4; ++k)
    if (result.rows[k].validation_ssim > result.rows[best].validation_ssim) best = k;
  EXPECT_LT(best, 3u);  // wrong colours lead away from the validation images
  EXPECT_EQ(result.best_step, result.rows[best].step);
  const ViewScores kept = ScoreViews(result.cloud, p.body, views, true, {});
  EXPECT_EQ(kept.ssim, result.validation_ssim);
  EXPECT_NEAR((kept.ssim[0] + kept.ssim[1] + kept.ssim[2]) / 3, result.rows[best].validation_ssim, 1e-12);
}

TEST(Train, ALossThatIsNotFiniteEndsItWithTheImages) {
  const Person& p = ThePerson();
  TrainOptions options = FewSteps(50);
  options.rates.colour = 1e30;
  const TrainResult result = TrainCloud(p.body, p.textures, Views(1, 32), {}, options, {});
  EXPECT_EQ(result.status, Status::kNotConverged);
  EXPECT_NE(result.trouble.find("camera 0"), std::string::npos);
  for (const float value : result.cloud.values.colour) ASSERT_TRUE(std::isfinite(value));
}

TEST(Train, RefusesViewsThatDoNotFit) {
  const Person& p = ThePerson();
  std::vector<TrainView> views = Views(1, 32);
  views[0].mask = Image(32, 32, 1, 0);
  EXPECT_THROW(TrainCloud(p.body, p.textures, views, {}, FewSteps(1), {}), ContractViolation);
  views = Views(1, 32);
  views[0].vertices = std::make_shared<const Eigen::Matrix3Xf>(3, 4);
  EXPECT_THROW(TrainCloud(p.body, p.textures, views, {}, FewSteps(1), {}), ContractViolation);
  EXPECT_THROW(TrainCloud(p.body, p.textures, {}, {}, FewSteps(1), {}), ContractViolation);
}

class CancelAfter : public ProgressSink {
 public:
  explicit CancelAfter(int steps) : left_(steps) {}
  void Advance(int64_t, const std::string&) override { --left_; }
  bool Cancelled() const override { return left_ <= 0; }

 private:
  int left_;
};

TEST(Train, CanBeCancelled) {
  const Person& p = ThePerson();
  CancelAfter sink(3);
  RunContext run;
  run.progress = &sink;
  EXPECT_THROW(TrainCloud(p.body, p.textures, Views(1, 32), {}, FewSteps(1000), run), CancelledError);
}

/// Random images on three triangles, rates ten times the usual: nothing may become NaN or infinite.
TEST(Train, TenThousandRandomStepsStayFinite) {
  testing::Scene scene = testing::RandomScene(24, 2, 9, 16, 16);
  Cloud cloud = CloudCast<float>(scene.cloud);
  const auto vertices = std::make_shared<const Eigen::Matrix3Xf>(scene.vertices.cast<float>());
  AdamState adam = MakeAdam(cloud.size(), 2);
  AdamRates rates;
  Rng rng(4);
  TrainView view;
  view.camera = scene.camera, view.vertices = vertices;
  view.image = Image(16, 16, 3), view.mask = Image(16, 16, 1);
  for (int step = 0; step < 10000; ++step) {
    for (uint8_t& value : view.image.pixels) value = static_cast<uint8_t>(rng.Index(256));
    for (uint8_t& value : view.mask.pixels) value = rng.Uniform() < 0.7 ? 255 : 0;
    const BatchResult result = BatchGradient(cloud, scene.faces, {&view}, {}, {}, step % 2 == 0, 1);
    ASSERT_TRUE(std::isfinite(result.loss.total)) << step;
    AdamStep(result.gradient, rates, 10, &adam, &cloud.values);
    Confine(&cloud);
    ForEachGroup(cloud.values, [&](Group group, int, const std::vector<float>& array) {
      for (const float value : array) ASSERT_TRUE(std::isfinite(value)) << static_cast<int>(group) << ", step " << step;
    });
  }
}

TEST(Train, CountFollowsThePixels) {
  const Person& p = ThePerson();
  const int64_t small = AutomaticCount(p.body, Views(2, 64)), large = AutomaticCount(p.body, Views(2, 128));
  EXPECT_NEAR(static_cast<double>(large) / static_cast<double>(small), 4, 0.05);
  const double pixel_m = 3 / 96.0;
  EXPECT_NEAR(static_cast<double>(small), 4 * SurfaceArea(p.body) / (pixel_m * pixel_m), 0.1 * static_cast<double>(small));
}

TEST(CoverBody, FollowsTheAreaAndTheTexels) {
  const Person& p = ThePerson();
  const Cloud cloud = CoverBody(p.body, p.textures, 3000, 1, 5);
  CheckCloud(cloud, static_cast<int>(p.body.faces.cols()));
  ASSERT_EQ(cloud.size(), 3000u);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero(), area_middle = Eigen::Vector3d::Zero();
  for (const int face : cloud.face)
    for (int k = 0; k < 3; ++k) middle += p.body.vertices.col(p.body.faces(k, face)).cast<double>() / 9000;
  for (Eigen::Index f = 0; f < p.body.faces.cols(); ++f) {
    const Eigen::Vector3d a = p.body.vertices.col(p.body.faces(0, f)).cast<double>(),
                          b = p.body.vertices.col(p.body.faces(1, f)).cast<double>(),
                          c = p.body.vertices.col(p.body.faces(2, f)).cast<double>();
    area_middle += (a + b + c) / 3 * 0.5 * (b - a).cross(c - a).norm() / SurfaceArea(p.body);
  }
  EXPECT_LT((middle - area_middle).norm(), 0.01);
  EXPECT_THROW(CoverBody(p.body, p.textures, 0, 0, 1), ContractViolation);
  EXPECT_THROW(CoverBody(p.body, p.textures, 10, 3, 1), ContractViolation);
}

TEST(Density, PixelSizesAreDepthOverFocalLength) {
  testing::Scene scene = testing::FacingScene(40, {{20, 20, 2}, {15, 22, 4}, {500, 20, 3}}, 0.02);
  const Cloud cloud = CloudCast<float>(scene.cloud);
  const Eigen::Matrix3Xf vertices = scene.vertices.cast<float>();
  geometry::RigCamera nearer = scene.camera;
  nearer.cam_from_world.translation[2] = -1;
  const auto sizes =
      PixelSizes(cloud, scene.faces, {ViewOf<float>(scene.camera), ViewOf<float>(nearer)}, {&vertices, &vertices}, 1);
  EXPECT_NEAR(sizes[0], 0.01, 1e-6);
  EXPECT_NEAR(sizes[1], 0.03, 1e-6);
  EXPECT_EQ(sizes[2], sizes[1]);  // beside both images: the coarsest
  Cloud filtered = cloud;
  SetFilters(sizes, &filtered);
  EXPECT_NEAR(filtered.filter_variance[1], 0.2 * 9e-4, 1e-9);
}

struct Crowd {
  testing::Scene scene = testing::FacingScene(40, {{10, 20, 2}, {20, 20, 2}, {30, 20, 2}, {5, 5, 2}}, 0.02);
  Cloud cloud = CloudCast<float>(scene.cloud);
  Eigen::Matrix3Xf rest = scene.vertices.cast<float>();
  AdamState adam = MakeAdam(4, 0);
  std::vector<float> pixel_m = {0.03f, 0.03f, 0.01f, 0.03f};
  ViewSpaceGradients gradients{{1, 9, 6, 7}, {10, 1, 1, 0}};
  DensityOptions options;
  Rng rng{1};

  Crowd() {
    options.growth = 0.5;
    for (size_t i = 0; i < 4; ++i) adam.first.offset[i] = static_cast<float>(i + 1);
  }
  DensityReport Run() { return Densify(options, scene.faces, rest, gradients, &rng, &cloud, &adam, &pixel_m); }
};

TEST(Density, DividesThoseThatMoveMost) {
  Crowd crowd;
  const Cloud before = crowd.cloud;
  const DensityReport report = crowd.Run();
  EXPECT_EQ(report.cloned, 1);  // 1: narrower than a pixel
  EXPECT_EQ(report.split, 1);   // 2: two pixels wide
  EXPECT_EQ(report.pruned, 0);
  ASSERT_EQ(crowd.cloud.size(), 6u);
  EXPECT_EQ(crowd.cloud.face, (std::vector<int>{0, 1, 2, 3, 1, 2}));
  // The clone and its origin are together as opaque as before.
  const auto opacity = [&](size_t i) { return 1 / (1 + std::exp(-crowd.cloud.values.opacity[i])); };
  EXPECT_NEAR(1 - (1 - opacity(1)) * (1 - opacity(4)), 0.5, 1e-5);
  // The halves of the split lie opposite each other, and are narrower along that axis.
  const Surface<float> surface{crowd.scene.faces, crowd.rest};
  const PinholeView<float> view = ViewOf<float>(crowd.scene.camera);
  const auto drawn = ProjectSplats(crowd.cloud, surface, view, {});
  const auto &a = drawn.splats[2], &b = drawn.splats[5];
  EXPECT_NEAR((a.x + b.x) / 2, 30, 1e-3);
  EXPECT_NEAR((a.y + b.y) / 2, 20, 1e-3);
  EXPECT_NEAR(std::hypot(a.x - b.x, a.y - b.y), 2 * 0.7 * 1.0, 1e-3);  // 0.02 m at 2 m and 100 px: 1 px
  EXPECT_NEAR(crowd.cloud.values.log_scale[6], before.values.log_scale[6] - 0.47, 1e-5);
  EXPECT_EQ(crowd.adam.first.offset, (std::vector<float>{1, 2, 3, 4, 0, 0}));
  EXPECT_EQ(crowd.pixel_m, (std::vector<float>{0.03f, 0.03f, 0.01f, 0.03f, 0.03f, 0.01f}));
}

TEST(Density, RemovesWhatIsTransparentAndKeepsTheLimit) {
  Crowd crowd;
  crowd.cloud.values.opacity[1] = -6, crowd.options.most = 5;
  const DensityReport report = crowd.Run();
  EXPECT_EQ(report.pruned, 1);
  EXPECT_EQ(report.cloned + report.split, 0);  // the one that there is room for was the transparent one
  EXPECT_EQ(crowd.cloud.face, (std::vector<int>{0, 2, 3}));
  EXPECT_EQ(crowd.adam.first.offset, (std::vector<float>{1, 3, 4}));
}

TEST(Density, ConfineKeepsWhatIsInside) {
  testing::Scene scene = testing::RandomScene(20, 1, 3);
  Cloud cloud = CloudCast<float>(scene.cloud);
  Confine(&cloud);
  Cloud again = cloud;
  Confine(&again);
  EXPECT_EQ(again.values.offset, cloud.values.offset);
  EXPECT_EQ(again.values.log_scale, cloud.values.log_scale);
  for (size_t i = 0; i < 20; ++i)
    EXPECT_NEAR(Eigen::Map<const Eigen::Vector4f>(cloud.values.rotation.data() + 4 * i).norm(), 1, 1e-6);
  cloud.values.offset[0] = 5, cloud.values.opacity[1] = 1e9f, cloud.values.place[0] = -3;
  for (size_t k = 0; k < 4; ++k) cloud.values.rotation[k] = 0;
  Confine(&cloud);
  EXPECT_EQ(cloud.values.offset[0], 0.1f);
  EXPECT_EQ(cloud.values.opacity[1], 6.f);
  EXPECT_EQ(cloud.values.place[0], -0.5f);
  EXPECT_EQ(cloud.values.rotation[3], 1.f);
}

/// On a quadratic bowl: one number of each group goes to its middle.
TEST(Adam, GoesDown) {
  Parameters<float> values = ZeroParameters<float>(1, 1);
  AdamState state = MakeAdam(1, 1);
  const AdamRates rates{0.01, 0.01, 0.01, 0.01, 0.01, 0.01};
  for (int step = 0; step < 2000; ++step) {
    Parameters<float> gradient = values;
    ForEachGroup(gradient, [](Group, int, std::vector<float>& array) {
      for (float& value : array) value = 1e-6f * (value - 0.3f);  // as small as a mean over pixels makes them
    });
    AdamStep(gradient, rates, 1, &state, &values);
  }
  ForEachGroup(values, [](Group, int, const std::vector<float>& array) {
    for (const float value : array) EXPECT_NEAR(value, 0.3f, 2e-3f);
  });
  Parameters<float> bad = ZeroParameters<float>(1, 1);
  bad.offset[0] = std::numeric_limits<float>::quiet_NaN();
  AdamStep(bad, rates, 1, &state, &values);
  EXPECT_TRUE(std::isfinite(values.offset[0]));
}

}  // namespace
}  // namespace mvstudio::splats
