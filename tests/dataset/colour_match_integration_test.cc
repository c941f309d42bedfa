#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "dataset/colour/colour_match.h"
#include "dataset/footage/image_io.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

using mvstudio::testing::MessageOf;

constexpr int kCameras = 6;
const std::vector<std::string> kNames{"00_00", "00_01", "00_02", "00_03", "00_04", "00_05"};

double ToLinear(double srgb) { return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4); }
double ToSrgb(double linear) { return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055; }

/// What a made studio is like.
struct Studio {
  std::vector<Eigen::Array3d> gain =
      std::vector<Eigen::Array3d>(kCameras, Eigen::Array3d::Ones());  // of own values to common ones
  std::vector<Eigen::Array3d> offset = std::vector<Eigen::Array3d>(kCameras, Eigen::Array3d::Zero());
  ColourSpace space = ColourSpace::kLinear;
  double low = 0.15, high = 0.6;  // of the colours, in the space
  double noise = 0.01;            // sRGB
  double outliers = 0;            // share of views
  int points = 1500;
};

/// Points on a ring of cameras: each is seen by two or three neighbours.
std::vector<ColourPoint> MakePoints(const Studio& studio, uint64_t seed) {
  Rng rng(seed);
  std::vector<ColourPoint> points;
  for (int i = 0; i < studio.points; ++i) {
    ColourPoint point;
    point.frame = i % 20;
    Eigen::Array3d colour;
    for (int k = 0; k < 3; ++k) colour[k] = rng.Uniform(studio.low, studio.high);
    const int first = static_cast<int>(rng.Index(kCameras)), count = 2 + static_cast<int>(rng.Index(2));
    for (int c = 0; c < count; ++c) {
      ColourPoint::View view;
      view.camera_idx = (first + c) % kCameras;
      for (int k = 0; k < 3; ++k) {
        const double own = (colour[k] - studio.offset[view.camera_idx][k]) / studio.gain[view.camera_idx][k];
        view.srgb[k] = (studio.space == ColourSpace::kLinear ? ToSrgb(own) : own) + studio.noise * rng.Normal();
        if (rng.Uniform() < studio.outliers) view.srgb[k] = rng.Uniform();
      }
      point.views.push_back(view);
    }
    points.push_back(point);
  }
  return points;
}

Studio UnevenStudio(ColourSpace space, bool offsets) {
  Rng rng(11);
  Studio studio;
  studio.space = space;
  Eigen::Array3d log_sum = Eigen::Array3d::Zero(), sum = Eigen::Array3d::Zero();
  for (int c = 0; c < kCameras; ++c) {
    for (int k = 0; k < 3; ++k) {
      studio.gain[c][k] = std::exp(0.15 * rng.Normal());
      studio.offset[c][k] = offsets ? 0.03 * rng.Normal() : 0;
    }
    log_sum += studio.gain[c].log();
    sum += studio.offset[c] / studio.gain[c];
  }
  for (int c = 0; c < kCameras; ++c) studio.gain[c] /= (log_sum / kCameras).exp();
  return studio;
}

double WorstGain(const ColourMatch& match, const Studio& studio) {
  double worst = 0;
  for (int c = 0; c < kCameras; ++c) worst = std::max(worst, (match.cameras[c].gain / studio.gain[c] - 1).abs().maxCoeff());
  return worst;
}

TEST(MatchColours, EvenCamerasStayAsTheyAre) {
  const ColourMatch match = MatchColours(MakePoints({}, 1), kNames);
  EXPECT_EQ(match.status, Status::kOk);
  EXPECT_EQ(match.model, ColourModel::kNone) << match.reason;
  for (const ColourTransform& t : match.cameras) EXPECT_TRUE(t.IsIdentity());
  EXPECT_EQ(match.trials.size(), 5u);
}

TEST(MatchColours, FindsGainsInTheSpaceThatTheyActIn) {
  for (const ColourSpace space : {ColourSpace::kLinear, ColourSpace::kSrgb}) {
    const Studio studio = UnevenStudio(space, false);
    const ColourMatch match = MatchColours(MakePoints(studio, 2), kNames);
    EXPECT_EQ(match.model, ColourModel::kGain) << match.reason;
    EXPECT_EQ(match.space, space) << match.reason;
    EXPECT_LT(WorstGain(match, studio), 0.01);
    for (const ColourTransform& t : match.cameras) EXPECT_LT(t.gain_sigma.maxCoeff(), 0.01);
  }
}

TEST(MatchColours, NoiseFreeIsExact) {
  Studio studio = UnevenStudio(ColourSpace::kLinear, true);
  studio.noise = 0;
  const ColourMatch match = MatchColours(MakePoints(studio, 3), kNames);
  ASSERT_EQ(match.model, ColourModel::kGainOffset) << match.reason;
  // Common values are free up to one gain and one offset for all cameras: compare what two cameras make of one colour.
  for (int c = 1; c < kCameras; ++c) {
    for (const double common : {0.2, 0.5}) {
      const auto seen = [&](int camera) {
        const Eigen::Array3d own = (common - studio.offset[camera]) / studio.gain[camera];
        return Eigen::Array3d(match.cameras[camera].gain * own + match.cameras[camera].offset);
      };
      EXPECT_LT((seen(c) - seen(0)).abs().maxCoeff(), 1e-6) << c;
    }
  }
}

TEST(MatchColours, OutliersDoNotMatter) {
  Studio studio = UnevenStudio(ColourSpace::kLinear, false);
  studio.outliers = 0.15, studio.points = 3000;
  const ColourMatch match = MatchColours(MakePoints(studio, 4), kNames);
  EXPECT_EQ(match.model, ColourModel::kGain) << match.reason;
  EXPECT_LT(WorstGain(match, studio), 0.02);
}

TEST(MatchColours, NoiseDoesNotShrinkTheContrast) {
  Studio studio = UnevenStudio(ColourSpace::kSrgb, true);
  studio.noise = 0.06, studio.points = 6000, studio.low = 0.2, studio.high = 0.8;
  ColourMatchOptions options;
  options.model = ColourModelChoice::kGainOffset, options.space = ColourSpaceChoice::kSrgb, options.reference = "00_00";
  const ColourMatch match = MatchColours(MakePoints(studio, 5), kNames, options);
  for (int c = 0; c < kCameras; ++c) {  // common values are those of camera 0
    const Eigen::Array3d expected = studio.gain[c] / studio.gain[0];
    EXPECT_LT((match.cameras[c].gain / expected - 1).abs().maxCoeff(), 0.05) << c;
  }
  EXPECT_TRUE((match.cameras[0].gain - 1).abs().maxCoeff() < 1e-9 && match.cameras[0].offset.abs().maxCoeff() < 1e-9);
}

TEST(MatchColours, FlatColoursCannotTellGainFromOffset) {
  Studio studio = UnevenStudio(ColourSpace::kLinear, true);
  studio.low = studio.high = 0.3;
  const ColourMatch match = MatchColours(MakePoints(studio, 6), kNames);
  EXPECT_EQ(match.model, ColourModel::kGain) << match.reason;
  for (const ColourTrial& trial : match.trials) {
    if (trial.model == ColourModel::kGainOffset) {
      EXPECT_EQ(trial.status, Status::kDegenerate);
    }
  }
  ColourMatchOptions forced;
  forced.model = ColourModelChoice::kGainOffset;
  const ColourMatch refused = MatchColours(MakePoints(studio, 6), kNames, forced);
  EXPECT_EQ(refused.status, Status::kDegenerate);
  EXPECT_NE(refused.reason.find("stay as they are"), std::string::npos);
  for (const ColourTransform& t : refused.cameras) EXPECT_TRUE(t.IsIdentity()) << "no gain is better than a made-up one";
}

TEST(MatchColours, CamerasWithoutEnoughInCommonAreLeftAlone) {
  std::vector<ColourPoint> points = MakePoints(UnevenStudio(ColourSpace::kLinear, false), 7);
  for (ColourPoint& point : points) {  // camera 5 sees nothing that others see
    point.views.erase(std::remove_if(point.views.begin(), point.views.end(), [](const auto& v) { return v.camera_idx == 5; }),
                      point.views.end());
  }
  points.erase(std::remove_if(points.begin(), points.end(), [](const auto& p) { return p.views.size() < 2; }), points.end());
  const ColourMatch match = MatchColours(points, kNames);
  EXPECT_EQ(match.cameras[5].status, Status::kTooFewViews);
  EXPECT_TRUE(match.cameras[5].IsIdentity());
  EXPECT_EQ(match.cameras[0].status, Status::kOk);
  EXPECT_EQ(match.model, ColourModel::kGain);
  points.resize(20);
  EXPECT_EQ(MatchColours(points, kNames).status, Status::kTooFewViews);
  EXPECT_EQ(MatchColours({}, kNames).status, Status::kTooFewViews);
  EXPECT_EQ(MatchColours({}, {}).status, Status::kTooFewViews);
}

TEST(MatchColours, ClippedChannelsAreLeftOut) {
  const Studio studio = UnevenStudio(ColourSpace::kLinear, false);
  std::vector<ColourPoint> points = MakePoints(studio, 8);
  Rng rng(1);
  for (ColourPoint& point : points) {
    for (auto& view : point.views) {
      if (rng.Uniform() < 0.2) view.srgb[static_cast<int>(rng.Index(3))] = std::nan("");
    }
  }
  EXPECT_LT(WorstGain(MatchColours(points, kNames), studio), 0.015);
}

TEST(MatchColours, SaysWhatIsWrong) {
  ColourMatchOptions options;
  EXPECT_NE(MessageOf<UsageError>([&] { FromString("gamma", &options.model); }).find("auto, none, gain"), std::string::npos);
  EXPECT_NE(MessageOf<UsageError>([&] { FromString("xyz", &options.space); }).find("linear or srgb"), std::string::npos);
  options.reference = "cam9";
  EXPECT_NE(MessageOf<UsageError>([&] { MatchColours({}, kNames, options); }).find("00_05"), std::string::npos);
}

TEST(ApplyColour, ActsInItsSpaceAndClips) {
  Image image(2, 1, 3);
  image.pixels = {100, 50, 200, 0, 255, 128};
  ColourTransform t;
  t.gain << 2, 0.5, 1;
  t.offset << 0, 0.1, -0.2;
  Image srgb = image, linear = image;
  ApplyColour(t, ColourSpace::kSrgb, &srgb);
  EXPECT_EQ(srgb.pixels, std::vector<uint8_t>({200, 51, 149, 0, 153, 77}));  // 50.5 rounds up
  ApplyColour(t, ColourSpace::kLinear, &linear);
  EXPECT_EQ(linear.pixels[0], std::lround(255 * ToSrgb(2 * ToLinear(100 / 255.0))));
  EXPECT_EQ(linear.pixels[5], std::lround(255 * ToSrgb(std::max(0.0, ToLinear(128 / 255.0) - 0.2))));
  EXPECT_THROW(ApplyColour({}, ColourSpace::kSrgb, std::make_unique<Image>(1, 1, 1).get()), ContractViolation);
}

/// person_a with its cameras' colours changed, and what was found.
ColourMatch MatchPersonA(const Studio& studio) {
  const PanopticDataset data = OpenPanopticDataset(DataFolder("person_a"));
  const std::vector<std::string> names = geometry::CameraNames(data.rig);
  std::vector<ColourTransform> inverse(names.size());
  for (size_t c = 0; c < names.size() && !studio.gain.empty(); ++c) {
    inverse[c].gain = studio.gain[c].inverse(), inverse[c].offset = -studio.offset[c] / studio.gain[c];
  }
  const ImageSource images = [&](int c, int frame) {
    Image image = ReadImage(data.ImagePath(names[c], frame));
    ApplyColour(inverse[c], studio.space, &image);
    return image;
  };
  const ImageSource masks = [&](int c, int frame) { return ReadImage(data.MaskPath(names[c], frame), true); };
  ColourMatchOptions options;
  options.frames = 12;
  const std::vector<ColourPoint> points = SampleSurfaceColours(data.rig, data.poses, images, masks, options, {});
  EXPECT_GT(points.size(), 4000u);
  return MatchColours(points, names, options);
}

TEST(MatchColours, PersonA) {
  if (!mvstudio::testing::HasData("person_a")) GTEST_SKIP() << "person_a is not there";
  Studio even;
  even.gain.clear();
  const ColourMatch untouched = MatchPersonA(even);
  EXPECT_EQ(untouched.model, ColourModel::kNone) << untouched.reason;
  const auto json = nlohmann::json::parse(ColourMatchToJsonText(untouched, std::vector<std::string>(10, "c")));
  EXPECT_EQ(json["model"], "none");
  EXPECT_EQ(json["cameras"].size(), 10u);

  for (const ColourSpace space : {ColourSpace::kLinear, ColourSpace::kSrgb}) {
    Studio uneven;
    uneven.space = space;
    uneven.gain.assign(10, Eigen::Array3d::Ones()), uneven.offset.assign(10, Eigen::Array3d::Zero());
    Rng rng(5);
    Eigen::Array3d mean = Eigen::Array3d::Zero();
    for (Eigen::Array3d& gain : uneven.gain) {
      for (int k = 0; k < 3; ++k) gain[k] = std::exp(0.15 * rng.Normal());
      mean += gain.log() / 10;
    }
    const ColourMatch match = MatchPersonA(uneven);
    EXPECT_EQ(match.model, ColourModel::kGain) << match.reason;
    EXPECT_EQ(match.space, space) << match.reason;
    double worst = 0, squared = 0;
    for (int c = 0; c < 10; ++c) {
      const Eigen::Array3d error = match.cameras[c].gain * mean.exp() / uneven.gain[c] - 1;
      worst = std::max(worst, error.abs().maxCoeff()), squared += error.square().sum() / 30;
    }
    EXPECT_LT(worst, 0.03);
    EXPECT_LT(std::sqrt(squared), 0.015);
    std::printf("person_a, gains of 15 %% in %s: found within %.4f rms, %.4f at worst\n", ToString(space).c_str(),
                std::sqrt(squared), worst);
  }
}

}  // namespace
}  // namespace mvstudio::dataset
