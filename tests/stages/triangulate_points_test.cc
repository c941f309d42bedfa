#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "stages/people/likely_cause.h"
#include "stages/triangulate/describe_parts.h"
#include "stages/triangulate/point_statistics.h"
#include "stages/triangulate/solve.h"
#include "tests/triangulate/support.h"

namespace mvstudio::stages {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using triangulate::DetectedFrame;
using triangulate::TakePoint;
using triangulate::TakeResult;

TakePoint PointOf(int frame, int joint, Status status, double z_m = 0, double rms_px = 0, double sigma_m = 0) {
  TakePoint entry;
  entry.frame = frame, entry.joint_idx = joint, entry.point.status = status, entry.point.rms_px = rms_px;
  entry.point.x_in_world = Eigen::Vector3d(0, 0, z_m);
  entry.point.covariance = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  return entry;
}

const geometry::Skeleton kSkeleton = geometry::PointsSkeleton({"hip", "knee", "toe"});

TEST(TriangulatePoints, FiguresOfAHandMadeTake) {
  TakeResult take;
  take.points = {PointOf(0, 0, Status::kOk, 0, 1, 0.002),   PointOf(0, 1, Status::kOk, 0.3, 2, 0.004),
                 PointOf(0, 2, Status::kLowParallax),       PointOf(1, 0, Status::kOk, 0, 3, 0.006),
                 PointOf(1, 1, Status::kOk, 0.5, 6, 0.008), PointOf(1, 2, Status::kOutlier)};
  take.points[0].point.num_unknown_cameras = 1;
  take.points[0].point.calibration_covariance = Eigen::Matrix3d::Identity();
  take.points[1].point.num_unknown_cameras = 2;  // but nothing is known of the others either
  take.solve_s = 0.5, take.num_persons = 1;
  PointStatistics statistics(3, {{0, 1}, {1, 2}});
  statistics.Add(take);
  EXPECT_EQ(statistics.num_ok(), 4);
  const nlohmann::json json = nlohmann::json::parse(PointMetrics(statistics.Figures({}, {}, kSkeleton)).dump());
  EXPECT_EQ(json["num_joints_tried"], 6);
  EXPECT_EQ(json["num_points"], 4);
  EXPECT_EQ(json["num_persons"], 1);
  EXPECT_EQ(json["num_sigma_lower_bounds"], 1);
  EXPECT_EQ(json["status_counts"], nlohmann::json::parse(R"({"Ok": 4, "LowParallax": 1, "Outlier": 1})"));
  EXPECT_EQ(json["mean_rms_px"], 3);
  EXPECT_EQ(json["median_rms_px"], 2.5);
  EXPECT_NEAR(json["median_sigma_mm"].get<double>(), 5, 1e-5);
  EXPECT_EQ(json["points_per_s"], 12);
  EXPECT_NEAR(json["limb_std_mm"].get<double>(), 100, 1e-9);
  ASSERT_EQ(json["limbs"].size(), 1u) << "the toe has no point";
  EXPECT_EQ(json["limbs"][0]["limb"], "hip-knee");
  EXPECT_NEAR(json["limbs"][0]["mean_mm"].get<double>(), 400, 1e-9);
  ASSERT_EQ(json["joints"].size(), 3u);
  EXPECT_EQ(json["joints"][0]["num"], 2);
  EXPECT_EQ(json["joints"][1]["rms_px"], 4);
  EXPECT_TRUE(json["joints"][2]["rms_px"].is_null());
}

TEST(TriangulatePoints, NoPointsGiveNullNotNaN) {
  const nlohmann::ordered_json metrics = PointMetrics(PointStatistics(3, {{0, 1}}).Figures({}, {}, kSkeleton));
  EXPECT_EQ(metrics["num_points"], 0);
  for (const char* key : {"mean_rms_px", "median_rms_px", "points_per_s", "median_sigma_mm", "limb_std_mm"}) {
    EXPECT_TRUE(metrics[key].is_null()) << key;
  }
}

/// Cameras a and b; who sees somebody sees the first joint, and `both` says whether the second sees it, too.
DetectedFrame Frame(int number, bool both) {
  triangulate::DetectedPerson person(2);
  person[0].score = 0.9;
  DetectedFrame frame{number, {{person}, {}}};
  if (both) frame.people[1].push_back(person);
  return frame;
}

TEST(TriangulatePoints, CamerasThatHardlyEverSeeAnybodyAreNamed) {
  geometry::Rig rig;
  for (const char* name : {"a", "b"}) rig.cameras.push_back(triangulate::LookAt(name, {1, 2, 3}, {0, 0, 0}));
  PointStatistics rare(2, {}), half(2, {});
  for (int f = 0; f < 4; ++f) rare.AddFrames({Frame(f, f == 2)}, {}), half.AddFrames({Frame(f, f % 2 == 0)}, {});
  const geometry::Skeleton skeleton = geometry::PointsSkeleton({"x", "y"});
  const PointFigures few = rare.Figures(rig, {"a", "b"}, skeleton), enough = half.Figures(rig, {"a", "b"}, skeleton);
  EXPECT_EQ(few.num_triangulable, 1);
  EXPECT_EQ(enough.num_triangulable, 2);
  const std::vector<Notice> warned = DetectionNotices(few, 1);
  ASSERT_EQ(warned.size(), 1u);
  EXPECT_EQ(warned[0].code, "TRI-FEW-DETECTIONS");
  EXPECT_EQ(warned[0].text, "b: people in 1 of 4 frames only");
  EXPECT_THAT(DetectionNotices(enough, 1), IsEmpty());
}

TEST(TriangulatePoints, ATakeIsLostBelowTheShare) {
  const auto check = [](int num_ok) {
    PointStatistics statistics(2, {});
    for (int f = 0; f < 100; ++f) statistics.AddFrames({Frame(f, true)}, {});
    TakeResult take;
    for (int f = 0; f < num_ok; ++f) take.points.push_back(PointOf(f, 0, Status::kOk));
    statistics.Add(take);
    const Loss loss = statistics.LossOf({});
    EXPECT_EQ(loss.reason, Loss::Reason::kUnknown);
    return DescribeLoss(loss, statistics.Figures({}, {}, geometry::PointsSkeleton({"x", "y"})), {});
  };
  const int limit = static_cast<int>(std::lround(100 * kLostShare));
  EXPECT_EQ(check(limit).exit, kExitOk);
  EXPECT_EQ(check(0).exit, kExitIllPosed);
  EXPECT_EQ(check(0).errors.at(0).code, "TRI-NO-POINTS");
  const CommandResult lost = check(limit - 1);
  EXPECT_EQ(lost.exit, kExitQualityGate);
  ASSERT_EQ(lost.errors.size(), 1u);
  EXPECT_EQ(lost.errors[0].code, "TRI-LOST");
  EXPECT_THAT(lost.errors[0].text, HasSubstr("only 49 of 100 joints"));
}

TEST(TriangulatePoints, PointsBehindTheCamerasAreCalledThat) {
  PointStatistics statistics(2, {});
  TakeResult take;
  for (int f = 0; f < 20; ++f) {
    statistics.AddFrames({Frame(f, true)}, {});
    take.points.push_back(PointOf(f, 0, f < 15 ? Status::kBehindCamera : Status::kOutlier));
  }
  statistics.Add(take);
  const Loss loss = statistics.LossOf({});
  EXPECT_EQ(loss.reason, Loss::Reason::kBehind);
  const PointFigures figures = statistics.Figures({}, {}, geometry::PointsSkeleton({"x", "y"}));
  const CommandResult result = DescribeLoss(loss, figures, {});
  EXPECT_THAT(result.errors.at(0).text, HasSubstr("15 of 20 would lie behind the cameras"));
  EXPECT_THAT(result.errors.at(0).hint, HasSubstr("option 'flip-y'"));
}

CommandResult Inconsistent(Inconsistency what, const TakeResult& take) {
  TriangulateReport report;
  report.rig.cameras.push_back(triangulate::LookAt("a", {1, 2, 3}, {0, 0, 0}, 1000, 300, 400));  // diagonal 500 px
  report.take = take, report.inconsistency = what;
  return DescribeInconsistency(report);
}

TEST(TriangulatePoints, WhatViewsDisagreeByIsSaid) {
  TakeResult take;
  take.sigma_px = 10, take.holdout.all.coverage = 0.2, take.holdout.all.median_px = 40;
  EXPECT_EQ(Inconsistent(Inconsistency::kNone, take).exit, kExitOk);
  const CommandResult bad = Inconsistent(Inconsistency::kNoise, take);
  EXPECT_EQ(bad.exit, kExitQualityGate);
  ASSERT_EQ(bad.errors.size(), 1u);
  EXPECT_EQ(bad.errors[0].code, "TRI-INCONSISTENT");
  EXPECT_THAT(bad.errors[0].text, HasSubstr("sigma 10.0 px is 2.0 % of the image's diagonal"));
  EXPECT_EQ(Inconsistent(Inconsistency::kNoNoiseExplains, take).errors[0].text,
            "views disagree: no noise of detections explains by how much");
  EXPECT_THAT(Inconsistent(Inconsistency::kFarFromPrediction, take).errors[0].text,
              HasSubstr("40 px from a camera's detections (median)"));
  EXPECT_THAT(Inconsistent(Inconsistency::kRarelyPredicted, take).errors[0].text, HasSubstr("predict only 20 %"));
}

TEST(TriangulatePoints, ViewsDisagreeFromAPartOfTheDiagonalOn) {
  constexpr double kDiagonalPx = 500;
  TakeResult take;
  take.sigma_px = 7.4;
  EXPECT_EQ(InconsistencyOf(take, kDiagonalPx), Inconsistency::kNone);
  take.sigma_px = 10;
  EXPECT_EQ(InconsistencyOf(take, kDiagonalPx), Inconsistency::kNoise);
  take.sigma_px = 10240;
  EXPECT_EQ(InconsistencyOf(take, kDiagonalPx), Inconsistency::kNoNoiseExplains) << "a search that ends is no estimate";
}

TEST(TriangulatePoints, CamerasMustPredictEachOther) {
  TakeResult far, rare;
  far.holdout.all.num_samples = rare.holdout.all.num_samples = 100;
  far.holdout.all.coverage = 1, far.holdout.all.median_px = 40;
  rare.holdout.all.coverage = 0.2;
  EXPECT_EQ(InconsistencyOf(far, 500), Inconsistency::kFarFromPrediction);
  EXPECT_EQ(InconsistencyOf(rare, 500), Inconsistency::kRarelyPredicted);
  far.holdout.all.median_px = 10;
  EXPECT_EQ(InconsistencyOf(far, 500), Inconsistency::kNone);
}

TEST(TriangulatePoints, ScoresThatLeaveEverythingOutAreSaid) {
  const auto check = [](double score) {
    PointStatistics statistics(2, {});
    for (int f = 0; f < 20; ++f) {
      triangulate::DetectedFrame frame = Frame(f, true);
      for (auto& people : frame.people) {
        for (auto& person : people) {
          for (triangulate::Keypoint& key : person) key = {{5, 6}, score};
        }
      }
      statistics.AddFrames({frame}, {});
    }
    const Loss loss = statistics.LossOf({});
    EXPECT_EQ(loss.reason, Loss::Reason::kScores);
    const CommandResult result = DescribeLoss(loss, {}, {});
    EXPECT_EQ(result.exit, kExitIllPosed);
    return result.errors.at(0).text;
  };
  EXPECT_THAT(check(0.05),
              HasSubstr("have a score below option 'min-score' 0.3 and are left out; quantiles 10, 50, 90 %: 0.05"));
  EXPECT_THAT(check(0), HasSubstr("have score 0, which means not seen"));
}

TEST(TriangulatePoints, CamerasAreWarnedOfOnce) {
  TakeResult take;
  take.cameras.resize(3);
  take.cameras[0].off = take.cameras[0].scaled = take.cameras[1].scaled = true;
  take.cameras[0].message = "a is off", take.cameras[1].message = "b is scaled";
  take.cameras[2].name = "c", take.cameras[2].num_detections = 100, take.cameras[2].num_rejected = 51;
  take.sides.cameras = {{"a", 100, 4, 0, {}, "a: 4 of 100"}, {"b", 100, 5, 0, {}, "b: 5 of 100"}, {"c", 100, 50, 0, {}, ""}};
  std::vector<std::string> said;
  for (const Notice& notice : CameraNotices(take)) said.push_back(notice.code + " " + notice.text);
  EXPECT_THAT(said,
              ::testing::ElementsAre(
                  "TRI-CAMERA-OFF a is off", "TRI-CAMERA-SCALED b is scaled",
                  "TRI-CAMERA-LEFTOUT c: 51 of 100 of its detections that were looked at fit no point of the other cameras",
                  "TRI-SIDES-SWAPPED b: 5 of 100"));
}

TEST(TriangulatePoints, MostCamerasOffAreOneWarning) {
  TakeResult take;
  take.cameras.resize(4);
  for (size_t c = 0; c < 4; ++c) take.cameras[c].name = std::string(1, static_cast<char>('a' + c));
  for (size_t c = 0; c < 3; ++c)
    take.cameras[c].off = true, take.cameras[c].mean_residual_px = {1.0 + static_cast<double>(c), -3};
  const std::vector<Notice> notices = CameraNotices(take);
  ASSERT_EQ(notices.size(), 1u);
  EXPECT_THAT(notices[0].text, HasSubstr("3 of 4 cameras are off on average, px: a (+1.0, -3.0), b (+2.0, -3.0), c"));
}

}  // namespace
}  // namespace mvstudio::stages
