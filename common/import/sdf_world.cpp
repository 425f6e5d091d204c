#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <sdf/sdf.hh>
#include <set>

#include "common/import/sdf.h"
#include "common/import/sdf_cache.h"
#include "common/import/sdf_document.h"
#include "common/import/sdf_model.h"
#include "common/import/sdf_pose.h"
#include "common/import/sdf_unmodelled.h"
#include "common/scene/scene_file.h"

namespace soda {
namespace {

namespace fs = std::filesystem;

// Models that libsdformat reads at once: it needs 50 ms for any document, and time grows with the square of its models.
constexpr std::size_t kBatch = 48;

// Whatever libsdformat cannot read it takes for URDF, whose parser complains of that on standard error: noise before
// our message. Keeps standard error away from the whole process while it lives (the soda command has no other threads
// here).
class QuietStandardError {
 public:
  QuietStandardError() : kept_(::dup(STDERR_FILENO)) {
    const int nowhere = ::open("/dev/null", O_WRONLY);
    if (kept_ >= 0 && nowhere >= 0) ::dup2(nowhere, STDERR_FILENO);
    if (nowhere >= 0) ::close(nowhere);
  }
  ~QuietStandardError() {
    if (kept_ < 0) return;
    ::dup2(kept_, STDERR_FILENO);
    ::close(kept_);
  }
  QuietStandardError(const QuietStandardError&) = delete;
  QuietStandardError& operator=(const QuietStandardError&) = delete;

 private:
  int kept_;
};

class WorldConverter {
 public:
  WorldConverter(const fs::path& path, const ProgressFn& progress)
      : source_(path.string()),
        base_(fs::absolute(path).parent_path()),
        progress_(progress),
        builder_(path.stem().string()),
        converter_(builder_, warnings_, source_, base_) {
    sdf::Console::Instance()->SetQuiet(true);  // what it has to say comes back as errors, or is found by us
    config_.SetFindCallback([base = base_](const std::string& uri) { return resolve_uri(uri, base).string(); });
  }

  Scene convert(const std::string& text) {
    document_ = take_apart(text, source_, base_);
    read_rest();
    read_templates();
    place_all();
    Scene& scene = builder_.scene;
    if (scene.bodies.empty()) throw SceneError(source_, "", "", "has no model with anything to collide");
    for (Joint& joint : scene.joints) order_ends(scene, joint);
    finish_joints(scene);
    validate(scene, source_);
    return std::move(scene);
  }

  std::vector<std::string> warnings() const { return warnings_.list(); }
  const std::vector<fs::path>& files() const { return converter_.files(); }

 private:
  void report(std::size_t done, std::size_t total) const {
    if (progress_) progress_(done, total);
  }

  // Returns the first error of libsdformat, if any. Its positions are those of our excerpts, so they are left out.
  std::string read(sdf::Root& root, const std::string& text) const {
    const QuietStandardError quiet;
    for (const sdf::Error& e : root.LoadSdfString(text, config_))
      if (e.Code() != sdf::ErrorCode::NONE) return e.Message();
    return {};
  }

  // World settings, and the models that are not independent.
  void read_rest() {
    Scene& scene = builder_.scene;
    scene.gravity = Vec3(0, 0, -9.8);  // SDF's default
    if (document_.rest.empty()) return;
    sdf::Root root;
    const std::string error = read(root, document_.rest);
    if (!error.empty()) throw SceneError(source_, "", "world", error);
    const sdf::World& world = *root.WorldByIndex(0);
    if (!world.Name().empty()) scene.name = world.Name();
    scene.gravity = Vec3(world.Gravity().X(), world.Gravity().Y(), world.Gravity().Z());
    if (const sdf::ElementPtr step = explicit_step(world)) scene.dt = step->Get<double>();
    if (world.Element()->HasElement("joint"))
      throw SceneError(source_, "", "joint",
                       "joints of a <world> are not read: put this one into a <model> that holds both of its models");
    warn_of_unmodelled(*world.Element(), "", 1, warnings_);
    for (std::uint64_t m = 0; m < world.ModelCount(); ++m) {
      const sdf::Model& model = *world.ModelByIndex(m);
      rest_.push_back(converter_.convert(model, 1));
      rest_names_.push_back(model.Name());
    }
  }

  static sdf::ElementPtr explicit_step(const sdf::World& world) {
    if (!world.Element()->HasElement("physics")) return nullptr;
    const sdf::ElementPtr physics = world.Element()->GetElement("physics");
    if (!physics->GetExplicitlySetInFile() || !physics->HasElement("max_step_size")) return nullptr;
    const sdf::ElementPtr step = physics->GetElement("max_step_size");
    return step->GetExplicitlySetInFile() ? step : nullptr;
  }

  std::string excerpt(std::size_t first, std::size_t last) const {
    std::string xml = "<?xml version='1.0'?><sdf version='" + document_.version + "'><world name='excerpt'>";
    for (std::size_t t = first; t < last; ++t) xml += document_.templates[t].xml;
    return xml + "</world></sdf>";
  }

  void read_templates() {
    const auto& templates = document_.templates;
    models_.resize(templates.size());
    // Two templates may have a name in common (a model of a population), but not in one document.
    for (std::size_t first = 0; first < templates.size();) {
      report(first, templates.size());
      std::set<std::string> names;
      std::size_t last = first;
      while (last < templates.size() && last - first < kBatch && names.insert(templates[last].name).second) ++last;
      read_batch(first, last);
      first = last;
    }
    report(templates.size(), templates.size());
  }

  void read_batch(std::size_t first, std::size_t last) {
    sdf::Root root;
    const std::string error = read(root, excerpt(first, last));
    const SdfTemplate& head = document_.templates[first];
    if (!error.empty() && last - first == 1)
      throw SceneError(source_, "model \"" + head.name + "\"", "", error, head.line);
    if (!error.empty()) {  // which one is it?
      for (std::size_t t = first; t < last; ++t) read_batch(t, t + 1);
      throw SceneError(source_, "", "", error, head.line);
    }
    const sdf::World& world = *root.WorldByIndex(0);
    for (std::size_t t = first; t < last; ++t) {
      const SdfTemplate& from = document_.templates[t];
      const sdf::Model* model = world.ModelByName(from.name);
      if (!model) throw SceneError(source_, "model \"" + from.name + "\"", "", "cannot be read", from.line);
      try {
        models_[t] = converter_.convert(*model, from.uses);
      } catch (const SceneError& e) {
        throw SceneError(e.source, e.body, e.field, e.reason, from.line);
      }
      warn_of_unmodelled(*model->Element(), from.name, from.uses, warnings_);
    }
  }

  void place_all() {
    for (const SdfEntry& entry : document_.entries) {
      line_ = entry.line;
      if (entry.kind == SdfEntry::Kind::kInRest) {
        if (entry.model >= rest_.size()) throw SceneError(source_, "", "model", "cannot be read", entry.line);
        const ConvertedModel& model = rest_[entry.model];
        place(model, rest_names_[entry.model], model.pose);
      } else if (entry.kind == SdfEntry::Kind::kInstance) {
        const ConvertedModel& model = models_[entry.model];
        place(model, entry.name, entry.pose ? *entry.pose * model.placement : model.pose);
      } else {
        const ConvertedModel& model = models_[entry.model];
        const Pose own = entry.pose ? *entry.pose * model.placement : model.pose;
        std::size_t n = 0;
        for (const Pose& at : places(entry.population, model.radius, warnings_))
          place(model, entry.name + "_clone_" + std::to_string(n++), at * own);
      }
    }
  }

  void place(const ConvertedModel& model, const std::string& name, const Pose& pose) {
    if (!names_.insert(name).second)
      throw SceneError(source_, "model \"" + name + "\"", "name", "is there twice", line_);
    const BodyId before = builder_.scene.bodies.size();
    for (const Body& part : model.bodies) {
      Body body = part;
      body.id = builder_.scene.bodies.size() + 1;
      body.name = name + "::" + part.name;
      body.pose = compose(pose, part.pose);
      builder_.scene.bodies.push_back(std::move(body));
    }
    for (Joint joint : model.joints) {
      joint.name = name + "::" + joint.name;
      for (auto [end, frame] : {std::pair{&joint.a, &joint.frame_a}, std::pair{&joint.b, &joint.frame_b}})
        if (*end == kWorldBody)
          *frame = compose(pose, *frame);
        else
          *end += before;
      builder_.scene.joints.push_back(std::move(joint));
    }
  }

  std::string source_;
  fs::path base_;
  const ProgressFn& progress_;
  sdf::ParserConfig config_;
  Warnings warnings_;
  SceneBuilder builder_;
  SdfModelConverter converter_;
  SdfDocument document_;
  std::vector<ConvertedModel> models_, rest_;  // of the templates; of the models that stayed in the world
  std::vector<std::string> rest_names_;
  std::set<std::string> names_;
  int line_ = 0;
};

}  // namespace

Scene load_sdf(const fs::path& path, const SdfOptions& options, std::vector<std::string>& warnings) {
  const std::string text = read_file(path);
  const SdfCache cache(path, text);
  if (options.use_cache) {
    if (const auto found = cache.find()) {
      try {
        Scene scene = decode_scene(found->scene, path.string());
        warnings.insert(warnings.end(), found->warnings.begin(), found->warnings.end());
        return scene;
      } catch (const SceneError&) {
        // damaged, or of an older format: made anew
      }
    }
  }
  WorldConverter converter(path, options.progress);
  Scene scene = converter.convert(text);
  const std::vector<std::string> found = converter.warnings();
  warnings.insert(warnings.end(), found.begin(), found.end());
  if (options.use_cache) cache.store({encode_scene(scene), found}, converter.files());
  return scene;
}

}  // namespace soda
