#include <Eigen/Cholesky>
#include <cmath>

#include "avatar/body/dynamic/dynamic_fit.h"
#include "core/error.h"
#include "tests/body/swelling_take.h"
#include "tests/support/message_of.h"
#include "tests/support/one_thread.h"
#include "tests/support/test.h"

/// A surface that moves with the pose beyond skinning.
namespace mvstudio::body {
namespace {

DynamicFit Fit(const SwellingTake& take, bool always = false) {
  const TakeOutlines outlines = TakeOutlinesOf(take.person, take.steps, {}, OneThread());
  LinearTraining training(outlines, OneThread());
  return FitDynamic(outlines, LinearTrainers(&training), always, OneThread());
}

TEST(FitDynamic, FindsWhatMovesWithThePose) {
  const SwellingTake take(24, 0.25);
  const DynamicFit fit = Fit(take);
  ASSERT_TRUE(fit.offsets) << fit.reason;
  EXPECT_NE(fit.reason.find("beats skinning in every block"), std::string::npos) << fit.reason;
  EXPECT_GT(fit.rms_m, 0.002);
  EXPECT_LE(fit.most_m, 0.1 + 1e-6);
  // A pose that is in none of the steps: outlines bring back a part of what skinning leaves open.
  const ArticulatedPose other = SwingingPose(40);
  const Eigen::Matrix3Xf truth = Swell(other, 0.25);
  EXPECT_LT((fit.offsets->At(Small(), other) - truth).norm(), 0.8f * truth.norm());
}

TEST(FitDynamic, StaysOffWhereSkinningExplainsAll) {
  const DynamicFit fit = Fit(SwellingTake(18, 0));
  EXPECT_FALSE(fit.offsets);
  EXPECT_EQ(fit.reason.rfind("off; the best was", 0), 0u) << fit.reason;
  EXPECT_EQ(fit.candidates.size(), 4u);
  EXPECT_EQ(fit.candidates[0].gains.size(), 5u);
}

TEST(FitDynamic, StaysOffWithFewTimeSteps) {
  const DynamicFit fit = Fit(SwellingTake(14, 0.15), true);
  EXPECT_FALSE(fit.offsets);
  EXPECT_NE(fit.reason.find("fewer than 15 time steps"), std::string::npos) << fit.reason;
}

TEST(FitDynamic, DoesWhatIsAskedForAndSaysThatItIsNoGain) {
  const DynamicFit fit = Fit(SwellingTake(15, 0), true);
  ASSERT_TRUE(fit.offsets);
  EXPECT_EQ(fit.reason.rfind("asked for; ", 0), 0u) << fit.reason;
  EXPECT_LT(fit.rms_m, 0.003);
}

TEST(FitMovingSurface, AddsToTheBodyOnlyWhatIsKept) {
  const SwellingTake take(18, 0.25);
  PersonBody off = take.person, moving = take.person;
  EXPECT_TRUE(FitMovingSurface(take.steps, {}, DynamicMode::kOff, nullptr, OneThread(), &off).reason.empty());
  EXPECT_EQ(off.body.pose_directions.size(), 0);
  const DynamicFit fit = FitMovingSurface(take.steps, {}, DynamicMode::kLinear, nullptr, OneThread(), &moving);
  ASSERT_TRUE(fit.offsets) << fit.reason;
  const ArticulatedPose& seen = take.person.seen.at(12);
  const Eigen::Matrix3Xf expected =
      SkinVertices(WithOffsets(off.body, fit.offsets->At(off.body, seen)), ToBodyPose(off.body, seen));
  EXPECT_LT((SkinVertices(moving.body, ToBodyPose(moving.body, seen)) - expected).cwiseAbs().maxCoeff(), 1e-5f);
}

struct NoOffsets : MovingOffsets {
  Eigen::Matrix3Xf At(const Eigen::Matrix3Xf& posed) const override { return Eigen::Matrix3Xf::Zero(3, posed.cols()); }
};

TEST(FitMovingSurface, TakesTheBetterOfBothKinds) {
  const SwellingTake take(18, 0.25);
  int asked = 0;
  const MakeNetworkTrainer still = [&](const TakeOutlines&) {
    ++asked;
    return OffsetTrainer{"a network's offsets", [](const std::vector<int>&) {
                           return std::optional(TrainedOffsets{std::nullopt, std::make_shared<NoOffsets>()});
                         }};
  };
  PersonBody best = take.person, linear = take.person, network = take.person;
  const DynamicFit chosen = FitMovingSurface(take.steps, {}, DynamicMode::kAuto, still, OneThread(), &best);
  ASSERT_EQ(chosen.candidates.size(), 5u);
  EXPECT_FALSE(chosen.candidates[4].beats) << "it changes nothing";
  ASSERT_TRUE(chosen.offsets) << chosen.reason;
  EXPECT_TRUE(chosen.offsets->linear);
  EXPECT_FALSE(best.body.moving_offsets);
  EXPECT_EQ(asked, 1);
  FitMovingSurface(take.steps, {}, DynamicMode::kLinear, still, OneThread(), &linear);
  EXPECT_EQ(asked, 1) << "linear needs no network";
  const DynamicFit all_the_same = FitMovingSurface(take.steps, {}, DynamicMode::kNetwork, still, OneThread(), &network);
  EXPECT_EQ(all_the_same.reason.rfind("asked for; a network's offsets", 0), 0u) << all_the_same.reason;
  EXPECT_TRUE(network.body.moving_offsets);
  EXPECT_EQ(network.body.pose_directions.size(), 0);
}

TEST(DynamicMode, IsOneOfFourWords) {
  for (const char* word : {"auto", "off", "linear", "network"}) {
    DynamicMode mode{};
    FromString(word, &mode);
    EXPECT_EQ(ToString(mode), word);
  }
  DynamicMode mode = DynamicMode::kOff;
  EXPECT_THAT(MessageOf<UsageError>([&] { FromString("net", &mode); }), HasSubstr("must be auto, off, linear or network"));
}

TEST(AddLinearOffsets, SkinsAsTheOffsetsDo) {
  std::vector<ArticulatedPose> poses;
  for (int i = 0; i < 20; ++i) poses.push_back(SwingingPose(i));
  LinearOffsets linear{FindTurnBasis(poses, 3), {}};
  ASSERT_GE(linear.basis.size(), 2);
  Rng rng(3);
  linear.weights.resize(Small().vertices.cols(), 3 * linear.basis.size());
  for (double& weight : linear.weights.reshaped()) weight = 0.02 * rng.Normal();
  BodyTemplate body = Small();
  for (int twice = 0; twice < 2; ++twice) {  // they add up
    AddLinearOffsets(linear, &body);
    const BodyPose posed = ToBodyPose(body, poses[7]);
    const Eigen::Matrix3Xf offsets = static_cast<float>(twice + 1) * linear.At(poses[7]);
    const Eigen::Matrix3Xf expected = SkinVertices(WithOffsets(Small(), offsets), posed);
    EXPECT_LT((SkinVertices(body, posed) - expected).cwiseAbs().maxCoeff(), 1e-5f);
  }
}

TEST(FindTurnBasis, HasUnitDeviationsAndNothingForAStillPerson) {
  std::vector<ArticulatedPose> poses;
  for (int i = 0; i < 40; ++i) poses.push_back(SwingingPose(i));
  const TurnBasis basis = FindTurnBasis(poses, 2);
  ASSERT_EQ(basis.size(), 2);
  Eigen::MatrixXd values(2, 40);
  for (int i = 0; i < 40; ++i) values.col(i) = basis.Values(poses[i]);
  EXPECT_LT(values.rowwise().mean().norm(), 1e-12);
  const Eigen::Matrix2d covariance = values * values.transpose() / 39;
  EXPECT_NEAR(covariance(0, 0), 1, 1e-9);
  EXPECT_NEAR(covariance(0, 1), 0, 1e-9);
  EXPECT_EQ(FindTurnBasis(std::vector<ArticulatedPose>(20, SwingingPose(1)), 3).size(), 0);
}

/// Random pulls on a tetrahedron's vertices, two values.
struct SmallProblem {
  Eigen::Matrix3Xf vertices{3, 4};
  Eigen::Matrix3Xi faces{3, 4};
  Eigen::SparseMatrix<double> stiffness;
  std::vector<std::vector<OffsetPull>> pulls;
  std::vector<Eigen::VectorXd> values;

  SmallProblem() {
    vertices << 0, 0.1f, 0, 0, 0, 0, 0.1f, 0, 0, 0, 0, 0.1f;
    faces << 0, 0, 0, 1, 2, 1, 3, 2, 1, 3, 2, 3;
    stiffness = StiffnessMatrix(vertices, faces, {1e-2, 0.5, 0.05});
    Rng rng(5);
    for (int i = 0; i < 6; ++i) {
      values.push_back(Eigen::Vector2d(rng.Normal(), rng.Normal()));
      pulls.emplace_back();
      for (int v = 0; v < 4; ++v) {
        const Eigen::Vector3d direction(rng.Normal(), rng.Normal(), rng.Normal());
        pulls.back().push_back({v, 100 * direction, 0.01 * rng.Normal(), 0.5});
      }
    }
  }
};

TEST(StepWeights, IsTheDenseSolution) {
  const SmallProblem problem;
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(24, 24);  // 6 v + 3 k + axis
  Eigen::VectorXd force = Eigen::VectorXd::Zero(24);
  const Eigen::MatrixXd stiff(problem.stiffness);
  for (int a = 0; a < 4; ++a) {
    for (int b = 0; b < 4; ++b) h.block<6, 6>(6 * a, 6 * b) += stiff(a, b) * Eigen::MatrixXd::Identity(6, 6);
  }
  for (size_t i = 0; i < problem.pulls.size(); ++i) {
    for (const OffsetPull& pull : problem.pulls[i]) {
      Eigen::VectorXd row(6);
      row << problem.values[i][0] * pull.direction, problem.values[i][1] * pull.direction;
      h.block<6, 6>(6 * pull.vertex, 6 * pull.vertex) += 0.25 * row * row.transpose();
      force.segment<6>(6 * pull.vertex) += 0.25 * pull.gap_px * row;
    }
  }
  const Eigen::VectorXd dense = h.ldlt().solve(force);  // gaps are far below three sigma: the loss is quadratic
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(4, 6);
  ASSERT_EQ(StepWeights(problem.stiffness, problem.pulls, problem.values, &weights), Status::kOk);
  for (int v = 0; v < 4; ++v)
    EXPECT_LT((weights.row(v).transpose() - dense.segment<6>(6 * v)).norm(), 1e-3 * dense.norm()) << v;
}

TEST(StepWeights, RefusesWhatIsNotFinite) {
  SmallProblem problem;
  problem.pulls[2][1].gap_px = std::nan("");
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(4, 6);
  EXPECT_EQ(StepWeights(problem.stiffness, problem.pulls, problem.values, &weights), Status::kNonFiniteInput);
  EXPECT_EQ(weights, Eigen::MatrixXd::Zero(4, 6));
}

TEST(LimitOffsets, ShrinksAVertexThatGoesTooFar) {
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(2, 3);
  weights.row(0) << 0.2, 0, 0;
  weights.row(1) << 0, 0.02, 0;
  LimitOffsets({Eigen::VectorXd::Constant(1, 2), Eigen::VectorXd::Constant(1, -1)}, 0.1, &weights);
  EXPECT_NEAR(weights(0, 0), 0.05, 1e-12);
  EXPECT_NEAR(weights(1, 1), 0.02, 1e-12);
}

}  // namespace
}  // namespace mvstudio::body
