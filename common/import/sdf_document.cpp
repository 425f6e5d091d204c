#include "common/import/sdf_document.h"

#include <tinyxml2.h>

#include <cstdlib>
#include <cstring>
#include <functional>
#include <set>
#include <sstream>
#include <unordered_map>

#include "common/scene/validate.h"

namespace soda {
namespace {

namespace fs = std::filesystem;
using tinyxml2::XMLElement;

constexpr const char* kResourcePaths[] = {"SDF_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH",
                                          "GAZEBO_MODEL_PATH"};

bool is(const XMLElement& element, const char* name) { return std::strcmp(element.Name(), name) == 0; }

void for_each_element(XMLElement& element, const std::function<void(XMLElement&)>& visit) {
  visit(element);
  for (XMLElement* child = element.FirstChildElement(); child; child = child->NextSiblingElement())
    for_each_element(*child, visit);
}

std::string print(const tinyxml2::XMLNode& node) {
  tinyxml2::XMLPrinter printer(nullptr, /*compact=*/true);
  node.Accept(&printer);
  return printer.CStr();
}

// All words by which one thing may name another: whatever stands in an attribute or a text.
void collect_words(const XMLElement& element, std::set<std::string>& words) {
  const auto add = [&](const char* text) {
    if (!text) return;
    std::string word = text;
    words.insert(word.substr(0, word.find("::")));
  };
  for (const tinyxml2::XMLAttribute* a = element.FirstAttribute(); a; a = a->Next())
    if (std::strcmp(a->Name(), "name") != 0) add(a->Value());
  add(element.GetText());
  for (const XMLElement* c = element.FirstChildElement(); c; c = c->NextSiblingElement()) collect_words(*c, words);
}

class TakingApart {
 public:
  TakingApart(const std::string& text, const std::string& source, const fs::path& base) : source_(source), base_(base) {
    if (xml_.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
      // tinyxml2's own text repeats the line number; its name of the error is what helps.
      throw SceneError(source_, "", "", std::string("is not well-formed XML: ") + xml_.ErrorName(),
                       xml_.ErrorLineNum());
    }
  }

  SdfDocument run() {
    XMLElement* root = xml_.RootElement();
    if (!root || !is(*root, "sdf"))
      throw SceneError(source_, "", root ? root->Name() : "", "is not SDF: its root must be <sdf>",
                       root ? root->GetLineNum() : 0);
    const char* version = root->Attribute("version");
    if (!version) throw SceneError(source_, "", "sdf", "must name its version", root->GetLineNum());
    document_.version = version;
    XMLElement* world = root->FirstChildElement("world");
    if (world && world->NextSiblingElement("world"))
      throw SceneError(source_, "", "world", "must be one", world->NextSiblingElement("world")->GetLineNum());
    make_uris_absolute(*root);
    XMLElement& container = world ? *world : *root;
    find_independent(container);
    sort_out(container);
    if (world) document_.rest = print(xml_);
    return std::move(document_);
  }

 private:
  void make_uris_absolute(XMLElement& root) {
    for_each_element(root, [&](XMLElement& element) {
      if (!is(element, "include")) return;
      XMLElement* uri = element.FirstChildElement("uri");
      if (!uri || !uri->GetText()) return;
      const fs::path found = resolve_uri(uri->GetText(), base_);
      if (found.empty())
        throw SceneError(source_, "", "include.uri", std::string("is not found: ") + uri->GetText(), uri->GetLineNum());
      uri->SetText(found.c_str());
    });
  }

  // The name of a top-level <model> or <include>; empty if that is only known from an included file.
  static std::string name_of(const XMLElement& element) {
    if (is(element, "model")) return element.Attribute("name") ? element.Attribute("name") : "";
    const XMLElement* name = element.FirstChildElement("name");
    return name && name->GetText() ? name->GetText() : "";
  }

  static bool can_stand_alone(const XMLElement& element) {
    if (!is(element, "model") && !is(element, "include")) return false;
    if (name_of(element).empty() || element.Attribute("placement_frame") ||
        element.FirstChildElement("placement_frame"))
      return false;
    const XMLElement* pose = element.FirstChildElement("pose");
    return !pose || read_plain_pose(*pose);
  }

  void find_independent(XMLElement& container) {
    std::set<std::string> words;  // of all that stays in the world
    for (XMLElement* e = container.FirstChildElement(); e; e = e->NextSiblingElement())
      if (!can_stand_alone(*e) && !is(*e, "population")) collect_words(*e, words);
    for (XMLElement* e = container.FirstChildElement(); e; e = e->NextSiblingElement())
      if (can_stand_alone(*e) && !words.contains(name_of(*e))) independent_.insert(e);
  }

  // Index of the template of a model; its XML is the same for all that differ in name and pose only.
  std::size_t template_of(const XMLElement& element, const std::string& name) {
    tinyxml2::XMLDocument alone;
    XMLElement* copy = element.DeepClone(&alone)->ToElement();
    alone.InsertEndChild(copy);
    if (XMLElement* pose = copy->FirstChildElement("pose")) copy->DeleteChild(pose);
    const bool is_model = is(*copy, "model");
    if (is_model)
      copy->DeleteAttribute("name");
    else if (XMLElement* old = copy->FirstChildElement("name"))
      copy->DeleteChild(old);
    const auto [entry, is_new] = template_index_.emplace(print(alone), document_.templates.size());
    if (is_new) {
      if (is_model)
        copy->SetAttribute("name", name.c_str());
      else
        copy->InsertNewChildElement("name")->SetText(name.c_str());
      document_.templates.push_back({name, print(alone), element.GetLineNum(), 0});
    }
    return entry->second;
  }

  void sort_out(XMLElement& container) {
    std::map<std::string, int> lines;  // of the models' names
    std::size_t in_rest = 0;
    std::vector<XMLElement*> taken;
    for (XMLElement* e = container.FirstChildElement(); e; e = e->NextSiblingElement()) {
      SdfEntry entry;
      entry.line = e->GetLineNum();
      if (is(*e, "population")) {
        entry.kind = SdfEntry::Kind::kPopulation;
        entry.population = read_population(*e, source_);
        const std::string label = "population \"" + entry.population.name + "\"";
        if (!populations_.insert(entry.population.name).second)
          throw SceneError(source_, label, "name", "is there twice", entry.line);
        const XMLElement* model = e->FirstChildElement("model");
        if (!model || name_of(*model).empty())
          throw SceneError(source_, label, "model", "must be given, with a name", entry.line);
        // Its own pose comes on top of each place.
        if (const XMLElement* pose = model->FirstChildElement("pose")) {
          entry.pose = read_plain_pose(*pose);
          if (!entry.pose)
            throw SceneError(source_, label, "model.pose", "must be x y z roll pitch yaw, relative to nothing",
                             pose->GetLineNum());
        }
        entry.model = template_of(*model, name_of(*model));
        entry.name = name_of(*model);
        document_.templates[entry.model].uses += entry.population.count;
        taken.push_back(e);
      } else if (independent_.contains(e)) {
        entry.name = name_of(*e);
        if (const XMLElement* pose = e->FirstChildElement("pose")) entry.pose = read_plain_pose(*pose);
        entry.model = template_of(*e, entry.name);
        ++document_.templates[entry.model].uses;
        const auto [other, is_new] = lines.emplace(entry.name, entry.line);
        if (!is_new)
          throw SceneError(source_, "model \"" + entry.name + "\"", "name",
                           "is also the name of the model in line " + std::to_string(other->second), entry.line);
        taken.push_back(e);
      } else if (is(*e, "model") || is(*e, "include")) {
        entry.kind = SdfEntry::Kind::kInRest;
        entry.model = in_rest++;
      } else {
        continue;
      }
      document_.entries.push_back(std::move(entry));
    }
    for (XMLElement* e : taken) container.DeleteChild(e);
  }

  std::string source_;
  fs::path base_;
  tinyxml2::XMLDocument xml_;
  SdfDocument document_;
  std::set<const XMLElement*> independent_;
  std::unordered_map<std::string, std::size_t> template_index_;
  std::set<std::string> populations_;
};

}  // namespace

SdfDocument take_apart(const std::string& text, const std::string& source, const fs::path& base) {
  return TakingApart(text, source, base).run();
}

fs::path resolve_uri(const std::string& uri, const fs::path& base) {
  std::string path = uri;
  bool search = false;
  if (const std::size_t colon = uri.find("://"); colon != std::string::npos) {
    const std::string scheme = uri.substr(0, colon);
    if (scheme != "file" && scheme != "model" && scheme != "package") return {};
    search = scheme != "file";
    path = uri.substr(colon + 3);
  }
  std::vector<fs::path> candidates{base / path};  // of an absolute path that is the path itself
  if (search) {
    for (fs::path folder = base; folder.has_relative_path(); folder = folder.parent_path()) {
      candidates.push_back(folder / path);
      candidates.push_back(folder / "models" / path);
    }
    for (const char* variable : kResourcePaths) {
      std::istringstream folders(std::getenv(variable) ? std::getenv(variable) : "");
      for (std::string folder; std::getline(folders, folder, ':');)
        if (!folder.empty()) candidates.push_back(fs::path(folder) / path);
    }
  }
  std::error_code error;
  for (const fs::path& candidate : candidates)
    if (fs::exists(candidate, error)) return fs::absolute(candidate).lexically_normal();
  return {};
}

std::string resource_paths() {
  std::string all;
  for (const char* variable : kResourcePaths)
    all += std::string(std::getenv(variable) ? std::getenv(variable) : "") + "\n";
  return all;
}

}  // namespace soda
