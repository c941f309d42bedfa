#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "dataset/masks/cut.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr int kWidth = 4, kHeight = 3, kPixels = kWidth * kHeight;

CutProblem RandomProblem(Rng* rng, double share_fixed) {
  CutProblem p;
  p.width = kWidth, p.height = kHeight;
  p.smoothness = rng->Uniform(0, 3), p.mean_contrast2 = rng->Uniform(5, 50);
  for (int i = 0; i < kPixels; ++i) {
    p.person_cost.push_back(static_cast<float>(rng->Uniform(0, 4)));
    p.background_cost.push_back(static_cast<float>(rng->Uniform(0, 4)));
    const Label fixed = rng->Uniform() < 0.5 ? Label::kPerson : Label::kBackground;
    p.label.push_back(rng->Uniform() < share_fixed ? fixed : Label::kFree);
    for (auto* contrast : {&p.contrast2_x, &p.contrast2_y, &p.contrast2_d, &p.contrast2_u})
      contrast->push_back(static_cast<float>(rng->Uniform(0, 100)));
  }
  return p;
}

/// Of two neighbours with different labels (Boykov and Jolly, ICCV 2001), from the pixel that holds their contrast.
double PairCost(const CutProblem& p, int x, int y, int dx, int dy) {
  const int u = x + dx, v = y + dy, at = y * p.width + x;
  if (u < 0 || u >= p.width || v >= p.height || p.label[at] == p.label[v * p.width + u]) return 0;
  const auto& contrast = dy == 0 ? p.contrast2_x : dx == 0 ? p.contrast2_y : dx > 0 ? p.contrast2_d : p.contrast2_u;
  return p.smoothness / std::hypot(dx, dy) * std::exp(-contrast[at] / (2 * p.mean_contrast2));
}

/// What the cut makes least, of labels that are all decided. `free`: whether a pixel's own costs count.
double Energy(const CutProblem& p, const std::vector<bool>& free) {
  double energy = 0;
  for (int y = 0; y < p.height; ++y) {
    for (int x = 0; x < p.width; ++x) {
      const int at = y * p.width + x;
      if (free[at]) energy += p.label[at] == Label::kPerson ? p.person_cost[at] : p.background_cost[at];
      energy += PairCost(p, x, y, 1, 0) + PairCost(p, x, y, 0, 1) + PairCost(p, x, y, 1, 1) + PairCost(p, x, y, -1, 1);
    }
  }
  return energy;
}

std::vector<bool> FreeOf(const CutProblem& p) {
  std::vector<bool> free;
  for (const Label label : p.label) free.push_back(label == Label::kFree);
  return free;
}

/// By trying all labels of the free pixels.
double LeastEnergy(CutProblem p, const std::vector<bool>& free) {
  double least = INFINITY;
  std::vector<int> at;
  for (int i = 0; i < kPixels; ++i) {
    if (free[i]) at.push_back(i);
  }
  for (int bits = 0; bits < 1 << at.size(); ++bits) {
    for (size_t k = 0; k < at.size(); ++k) p.label[at[k]] = bits >> k & 1 ? Label::kPerson : Label::kBackground;
    least = std::min(least, Energy(p, free));
  }
  return least;
}

TEST(SolveCut, FindsTheLeastOfAllLabellings) {
  Rng rng(1);
  for (int trial = 0; trial < 60; ++trial) {
    CutProblem p = RandomProblem(&rng, trial % 3 * 0.25);
    const std::vector<bool> free = FreeOf(p);
    const double least = LeastEnergy(p, free);
    const std::vector<Label> given = p.label;
    SolveCut(&p);
    for (int i = 0; i < kPixels; ++i) {
      ASSERT_NE(p.label[i], Label::kFree) << trial;
      if (!free[i]) {
        EXPECT_EQ(p.label[i], given[i]) << "was decided before";
      }
    }
    EXPECT_NEAR(Energy(p, free), least, 1e-6) << trial;
  }
}

/// Free pixels that touch no other: a graph without edges.
TEST(SolveCut, PixelsAmongDecidedOnesFollowThemAndTheirCosts) {
  Rng rng(2);
  CutProblem p = RandomProblem(&rng, 1);
  p.label.assign(kPixels, Label::kBackground);
  p.label[0] = p.label[2] = p.label[11] = Label::kFree;
  for (const int at : {0, 2, 11}) p.person_cost[at] = 1, p.background_cost[at] = 2;
  p.smoothness = 1e-6;
  CutProblem stiff = p;
  stiff.smoothness = 100;
  for (auto* contrast : {&stiff.contrast2_x, &stiff.contrast2_y, &stiff.contrast2_d, &stiff.contrast2_u})
    contrast->assign(kPixels, 0);
  SolveCut(&p), SolveCut(&stiff);
  for (const int at : {0, 2, 11}) {
    EXPECT_EQ(p.label[at], Label::kPerson) << at;
    EXPECT_EQ(stiff.label[at], Label::kBackground) << at << ": all its neighbours are";
  }
}

TEST(SolveCut, NothingFreeStaysAsItIs) {
  Rng rng(3);
  CutProblem p = RandomProblem(&rng, 1);
  const std::vector<Label> given = p.label;
  SolveCut(&p);
  EXPECT_EQ(p.label, given);
}

}  // namespace
}  // namespace mvstudio::dataset::internal
