#include "triangulate/budget/substitute.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/statistics.h"

namespace mvstudio::triangulate::internal {
namespace {

constexpr size_t kHeldOutPoints = 1500;  // about; each gives a sample a camera
constexpr double kTruthNoisePx = 0.01;
constexpr double kWrongOfDiagonal = 0.03;  // farther from every true joint: something else

/// Joints of people at a time between the steps: a cubic through four where they are, else linear; nothing beyond the ends.
std::optional<Eigen::Vector3d> JointAt(const std::map<int, TruePeople>& people, size_t person, size_t joint, double time) {
  const auto at = [&](int step) -> std::optional<Eigen::Vector3d> {
    const auto found = people.find(step);
    if (found == people.end() || person >= found->second.size()) return std::nullopt;
    return found->second[person][joint];
  };
  const int step = static_cast<int>(std::floor(time + 1e-6));
  const double u = time - step;
  const auto b = at(step), c = at(step + 1);
  if (std::abs(u) < 1e-6 || !b) return b;
  if (!c) return std::nullopt;
  const auto a = at(step - 1), d = at(step + 2);
  if (!a || !d) return Eigen::Vector3d((1 - u) * *b + u * *c);
  return Eigen::Vector3d(-u * (u - 1) * (u - 2) / 6 * *a + (u + 1) * (u - 1) * (u - 2) / 2 * *b -
                         (u + 1) * u * (u - 2) / 2 * *c + (u + 1) * u * (u - 1) / 6 * *d);
}

std::vector<size_t> MirrorOf(const TakeBody& body) {
  std::vector<size_t> mirror(static_cast<size_t>(body.num_joints));
  for (size_t j = 0; j < mirror.size(); ++j) mirror[j] = j;
  for (const auto& group : body.mirror) {
    for (const auto& [left, right] : group) std::swap(mirror[static_cast<size_t>(left)], mirror[static_cast<size_t>(right)]);
  }
  return mirror;
}

DetectedPerson OtherSides(const DetectedPerson& person, const std::vector<size_t>& mirror) {
  DetectedPerson other = person;
  for (size_t j = 0; j < person.size(); ++j) other[j] = person[mirror[j]];
  return other;
}

/// Pairs of lowest cost, each side once.
template <class Use>
void MatchGreedily(std::vector<std::tuple<double, size_t, size_t>> costs, const Use& use) {
  std::sort(costs.begin(), costs.end());
  std::vector<bool> left, right;
  for (const auto& [cost, a, b] : costs) {
    left.resize(std::max(left.size(), a + 1)), right.resize(std::max(right.size(), b + 1));
    if (left[a] || right[b]) continue;
    left[a] = right[b] = true;
    use(a, b);
  }
}

}  // namespace

void CentreClocks(const BudgetTruth& truth, std::vector<Clock>* clocks) {
  std::vector<double> apart;
  for (size_t c = 0; c < clocks->size(); ++c) apart.push_back((*clocks)[c].offset_frames - truth.offset_frames[c]);
  const double shift = LinearQuantile(FiniteValues(apart), 0.5);
  for (Clock& clock : *clocks) clock.offset_frames -= shift;
}

Substitution::Substitution(const BudgetTake& take, const BudgetTruth& truth, const RunContext& run)
    : take_(take), truth_(truth), run_(run), mirror_(MirrorOf(take.body)) {
  run_.progress = nullptr;
  for (const auto& [step, people] : truth.people) {
    steps_.emplace(step, steps_.size());
    num_persons_ = std::max(num_persons_, people.size());
    for (const auto& person : people)
      num_joints_ +=
          static_cast<size_t>(std::count_if(person.begin(), person.end(), [](const auto& x) { return x.has_value(); }));
  }
  stride_ = std::max<size_t>(1, num_joints_ / kHeldOutPoints);
  const size_t cameras = take.rig.cameras.size();
  filmed_.assign(cameras, {take.frames.size(), 0});
  for (size_t f = 0; f < take.frames.size(); ++f) {
    std::vector<ImageTruth>& images = images_.emplace_back();
    for (size_t c = 0; c < cameras; ++c) {
      images.push_back(TruthOfImage(take.frames[f], c));
      if (take.frames[f].people[c].empty()) continue;
      filmed_[c] = {std::min(filmed_[c].first, f), f};
    }
  }
  CollectResiduals();
}

double Substitution::Cost(const DetectedPerson& person, const std::vector<std::optional<Eigen::Vector2d>>& px, bool swapped,
                          double limit_px) const {
  double sum = 0, count = 0;
  for (size_t j = 0; j < person.size(); ++j) {
    const auto& at = px[swapped ? mirror_[j] : j];
    if (!(person[j].score > 0) || !at) continue;
    sum += std::min(limit_px, (person[j].px - *at).norm()), ++count;
  }
  return count > 0 ? sum / count : limit_px;
}

std::vector<Substitution::Identity> Substitution::Identify(const std::vector<DetectedPerson>& people, const ImageTruth& truth,
                                                           double limit_px) const {
  std::vector<std::tuple<double, size_t, size_t>> costs;
  for (size_t d = 0; d < people.size(); ++d) {
    for (size_t p = 0; p < truth.px.size(); ++p) {
      const double cost = std::min(Cost(people[d], truth.px[p], false, limit_px), Cost(people[d], truth.px[p], true, limit_px));
      if (cost < 0.8 * limit_px) costs.emplace_back(cost, d, p);
    }
  }
  std::vector<Identity> seen(people.size());
  MatchGreedily(costs, [&](size_t d, size_t p) {
    const double straight = Cost(people[d], truth.px[p], false, limit_px),
                 exchanged = Cost(people[d], truth.px[p], true, limit_px);
    seen[d] = {static_cast<int>(p), exchanged < 0.5 * straight};
  });
  return seen;
}

Substitution::ImageTruth Substitution::TruthOfImage(const DetectedFrame& frame, size_t camera) const {
  ImageTruth image;
  const geometry::RigCamera& seen_by = truth_.rig.cameras[camera];
  const geometry::Projector projector(seen_by.camera);
  Rng rng(run_.seed + 7919 * static_cast<uint64_t>(frame.frame) + camera);
  for (size_t p = 0; p < num_persons_; ++p) {
    auto& px = image.px.emplace_back(mirror_.size());
    for (size_t j = 0; j < px.size(); ++j) {
      const auto x = JointAt(truth_.people, p, j, frame.frame - truth_.offset_frames[camera]);
      if (!x) continue;
      const geometry::Projection at = projector.Project(seen_by.cam_from_world * *x);
      // A little noise, so that none is never estimated: identities would hang on rounding.
      if (at.status == Status::kOk) px[j] = at.px + kTruthNoisePx * Eigen::Vector2d(rng.Normal(), rng.Normal());
    }
  }
  const double diagonal_px = std::hypot(seen_by.camera.width_px, seen_by.camera.height_px);
  image.seen = Identify(frame.people[camera], image, 4 * kWrongOfDiagonal * diagonal_px);
  return image;
}

void Substitution::CollectResiduals() {
  residuals_.resize(take_.rig.cameras.size());
  for (size_t f = 0; f < images_.size(); ++f) {
    for (size_t c = 0; c < residuals_.size(); ++c) {
      const ImageTruth& image = images_[f][c];
      for (size_t d = 0; d < image.seen.size(); ++d) {
        if (image.seen[d].person < 0) continue;
        const auto& px = image.px[static_cast<size_t>(image.seen[d].person)];
        const DetectedPerson& person = take_.frames[f].people[c][d];
        for (size_t j = 0; j < person.size(); ++j) {
          const auto& at = px[image.seen[d].swapped ? mirror_[j] : j];
          if (person[j].score >= take_.options.min_score && person[j].score > 0 && at)
            residuals_[c].push_back(person[j].px - *at);
        }
      }
    }
  }
}

bool Substitution::Missed(size_t frame, size_t camera, size_t person) const {
  if (frame < filmed_[camera].first || frame > filmed_[camera].second) return false;
  const ImageTruth& image = images_[frame][camera];
  for (const Identity& seen : image.seen) {
    if (seen.person == static_cast<int>(person)) return false;
  }
  size_t inside = 0, there = 0;
  for (const auto& px : image.px[person]) {
    there += px.has_value();
    inside += px && geometry::InImage(truth_.rig.cameras[camera].camera, *px);
  }
  return there > 0 && 2 * inside >= there;
}

/// A missed person as the camera would have seen it: with errors of others that it saw.
void Substitution::AddMissed(size_t frame, size_t camera, bool exact, int only, std::vector<DetectedPerson>* people) const {
  Rng rng(run_.seed + 1000003 * frame + camera);
  for (size_t p = 0; p < num_persons_; ++p) {
    if ((only >= 0 && p != static_cast<size_t>(only)) || !Missed(frame, camera, p)) continue;
    DetectedPerson person(mirror_.size());
    for (size_t j = 0; j < person.size(); ++j) {
      const auto& px = images_[frame][camera].px[p][j];
      if (!px || !geometry::InImage(truth_.rig.cameras[camera].camera, *px)) continue;
      person[j] = {*px, 1};
      const auto& errors = residuals_[camera];
      if (!exact && !errors.empty())
        person[j].px += errors[static_cast<size_t>(rng.Index(static_cast<int64_t>(errors.size())))];
    }
    people->push_back(std::move(person));
  }
}

DetectedFrame Substitution::FrameWith(size_t f, const Truths& truths, int only) const {
  const std::vector<bool>& exact = truths[static_cast<size_t>(BudgetStage::kJoints2d)];
  const std::vector<bool>& known = truths[static_cast<size_t>(BudgetStage::kPeople)];
  DetectedFrame frame{take_.frames[f].frame, {}};
  for (size_t c = 0; c < exact.size(); ++c) {
    std::vector<DetectedPerson>& people = frame.people.emplace_back();
    const ImageTruth& image = images_[f][c];
    for (size_t d = 0; d < image.seen.size(); ++d) {
      const Identity& seen = image.seen[d];
      if (only >= 0 && seen.person != only) continue;
      DetectedPerson person = take_.frames[f].people[c][d];
      for (size_t j = 0; exact[c] && seen.person >= 0 && j < person.size(); ++j) {
        const auto& px = image.px[static_cast<size_t>(seen.person)][seen.swapped ? mirror_[j] : j];
        if (px) person[j].px = *px;
      }
      people.push_back(known[c] && seen.swapped ? OtherSides(person, mirror_) : person);
    }
    if (known[c]) AddMissed(f, c, exact[c], only, &people);
  }
  return frame;
}

Truths Substitution::Sets(size_t set) const {
  Truths truths;
  for (size_t i = 0; i < kNumBudgetStages; ++i) truths[i].assign(take_.rig.cameras.size(), set >> i & 1);
  return truths;
}

TakeProblem Substitution::Problem(const geometry::Rig& rig, const Truths& truths, int only) const {
  std::vector<DetectedFrame> frames;
  for (size_t f = 0; f < images_.size(); ++f) frames.push_back(FrameWith(f, truths, only));
  std::vector<Clock> clocks = take_.clocks;
  for (size_t c = 0; c < clocks.size(); ++c) {
    if (truths[static_cast<size_t>(BudgetStage::kSync)][c]) clocks[c] = {truth_.offset_frames[c], 1};
  }
  TakeOptions options = take_.options;
  options.max_persons = only >= 0 ? 1 : static_cast<int>(std::max<size_t>(1, num_persons_));
  options.fix_sides &= only < 0;
  return PrepareTake(rig, ApplyClocks(frames, clocks, kMeasuredBeyond), take_.body, options, run_);
}

int64_t Substitution::KeyOf(const PointLabel& label, int person) const {
  const auto step = static_cast<int64_t>(steps_.at(label.frame));
  return (step * static_cast<int64_t>(num_persons_) + person) * static_cast<int64_t>(mirror_.size()) + label.joint_idx;
}

size_t Substitution::StepOf(int64_t key, bool px) const {
  if (px) key /= static_cast<int64_t>(take_.rig.cameras.size());
  return static_cast<size_t>(key) / (num_persons_ * mirror_.size());
}

/// Who each solved person is, by time step: the nearest true ones.
std::vector<Substitution::PersonOf> Substitution::Match(const TakeProblem& problem, const std::vector<Point>& points,
                                                        int only) const {
  const size_t solved = static_cast<size_t>(problem.num_persons);
  std::vector<PersonOf> persons(steps_.size(), PersonOf(solved, only));
  if (only >= 0) return persons;
  // [step][solved person][true person]: sum and number of distances
  std::vector<std::vector<std::pair<double, int>>> sums(steps_.size(),
                                                        std::vector<std::pair<double, int>>(solved * num_persons_));
  for (size_t i = 0; i < points.size(); ++i) {
    const PointLabel& label = problem.labels[i];
    const auto step = steps_.find(label.frame);
    if (step == steps_.end() || points[i].status != Status::kOk) continue;
    const TruePeople& people = truth_.people.at(label.frame);
    for (size_t p = 0; p < people.size(); ++p) {
      const auto& x = people[p][static_cast<size_t>(label.joint_idx)];
      auto& [sum, count] = sums[step->second][static_cast<size_t>(label.person) * num_persons_ + p];
      if (x) sum += (points[i].x_in_world - *x).norm(), ++count;
    }
  }
  for (size_t s = 0; s < sums.size(); ++s) {
    std::vector<std::tuple<double, size_t, size_t>> costs;
    for (size_t i = 0; i < sums[s].size(); ++i) {
      if (sums[s][i].second > 0) costs.emplace_back(sums[s][i].first / sums[s][i].second, i / num_persons_, i % num_persons_);
    }
    MatchGreedily(costs, [&](size_t from, size_t to) { persons[s][from] = static_cast<int>(to); });
  }
  return persons;
}

const std::optional<Eigen::Vector3d>* Substitution::TrueJoint(const PointLabel& label, const PersonOf& person_of) const {
  const int person = person_of[static_cast<size_t>(label.person)];
  const TruePeople& people = truth_.people.at(label.frame);
  if (person < 0 || static_cast<size_t>(person) >= people.size()) return nullptr;
  const auto& x = people[static_cast<size_t>(person)][static_cast<size_t>(label.joint_idx)];
  return x ? &x : nullptr;
}

void Substitution::ScoreHeldOut(const TakeProblem& problem, const PointSolver& solve, const std::vector<PersonOf>& persons,
                                BudgetErrors* errors) const {
  std::vector<std::vector<Observation>> observations;
  std::vector<int64_t> keys;
  for (size_t i = 0; i < problem.labels.size(); ++i) {
    const PointLabel& label = problem.labels[i];
    const auto step = steps_.find(label.frame);
    if (step == steps_.end() || !TrueJoint(label, persons[step->second])) continue;
    const int64_t key = KeyOf(label, persons[step->second][static_cast<size_t>(label.person)]);
    if (static_cast<size_t>(key) % stride_ != 0) continue;
    observations.push_back(problem.observations[i]), keys.push_back(key);
  }
  const auto cameras = static_cast<int64_t>(take_.rig.cameras.size());
  for (const LeftOutSample& sample : LeaveOneCameraOut(problem.rig, observations, solve, run_.num_threads)) {
    if (sample.status == Status::kOk) errors->px[keys[sample.point] * cameras + sample.camera_idx] = sample.residual_px.norm();
  }
}

void Substitution::Score(const geometry::Rig& rig, const TakeProblem& problem, int only, BudgetErrors* errors) const {
  TakeOptions options = take_.options;
  options.select_views |= options.method.IsAuto();
  options.calibration_covariance = false;
  const PointSolver solve = SolverFor(rig, problem, options, options.method);
  const std::vector<Point> points = SolvePoints(problem, solve, run_.num_threads);
  const std::vector<PersonOf> persons = Match(problem, points, only);
  for (size_t i = 0; i < points.size(); ++i) {
    const PointLabel& label = problem.labels[i];
    const auto step = steps_.find(label.frame);
    if (step == steps_.end() || points[i].status != Status::kOk) continue;
    const auto* x = TrueJoint(label, persons[step->second]);
    if (!x) continue;
    errors->mm[KeyOf(label, persons[step->second][static_cast<size_t>(label.person)])] =
        1000 * (points[i].x_in_world - **x).norm();
  }
  ScoreHeldOut(problem, solve, persons, errors);
}

BudgetErrors Substitution::Solve(const Truths& truths) const {
  geometry::Rig rig = take_.rig;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    if (truths[static_cast<size_t>(BudgetStage::kCalibration)][c]) rig.cameras[c] = truth_.rig.cameras[c];
  }
  BudgetErrors errors;
  const std::vector<bool>& known = truths[static_cast<size_t>(BudgetStage::kPeople)];
  if (std::find(known.begin(), known.end(), false) != known.end()) {
    Score(rig, Problem(rig, truths, -1), -1, &errors);
    return errors;
  }
  for (int p = 0; p < static_cast<int>(num_persons_); ++p) Score(rig, Problem(rig, truths, p), p, &errors);
  return errors;
}

void Substitution::DescribeImages(size_t camera, BudgetCamera* out) const {
  std::vector<double> x, y, about;
  for (const Eigen::Vector2d& r : residuals_[camera]) x.push_back(r.x()), y.push_back(r.y());
  if (!x.empty()) out->bias_px = {LinearQuantile(x, 0.5), LinearQuantile(y, 0.5)};
  for (const Eigen::Vector2d& r : residuals_[camera]) {
    about.push_back(std::abs(r.x() - out->bias_px.x())), about.push_back(std::abs(r.y() - out->bias_px.y()));
  }
  if (!about.empty()) out->noise_px = kSigmaPerMad * LinearQuantile(about, 0.5);
  for (size_t f = 0; f < images_.size(); ++f) {
    for (const Identity& seen : images_[f][camera].seen) out->num_people += seen.person >= 0, out->num_swapped += seen.swapped;
    for (size_t p = 0; p < num_persons_; ++p) out->num_missed += Missed(f, camera, p);
  }
}

}  // namespace mvstudio::triangulate::internal
