"""Titles of columns in English, German and French, by the name in `rubberfric.io.COLUMNS`."""

# Titles by name. M_... stands for E_... or G_..., and N_... for D_... or J_..., see
# `rubberfric.io.columns.known_name`.
SPELLINGS = {
    name: tuple(text.split("; "))
    for name, text in {
        "E_stor": "E'; e storage",
        "E_loss": "E''; e loss",
        "E_comp": "|E*|; E*",
        "G_stor": (
            "G'; g storage; shear modulus (elastic component); shear storage modulus; schubspeichermodul; "
            "speicherschubmodul; module de conservation en cisaillement"
        ),
        "G_loss": (
            "G''; g loss; shear modulus (viscous component); shear loss modulus; schubverlustmodul; "
            "verlustschubmodul; module de perte en cisaillement"
        ),
        "G_comp": (
            "|G*|; G*; shear modulus (complex component); complex shear modulus; dynamic shear modulus; "
            "komplexer schubmodul; module de cisaillement complexe; module complexe de cisaillement"
        ),
        "M_stor": (
            "M'; storage modulus; elastic modulus; speichermodul; module de conservation; "
            "module de stockage; module élastique"
        ),
        "M_loss": (
            "M''; loss modulus; viscous modulus; verlustmodul; module de perte; module de dissipation; "
            "module visqueux"
        ),
        "M_comp": (
            "|M*|; complex modulus; dynamic modulus; komplexer modul; betrag komplexer modul; "
            "dynamischer modul; module complexe; module dynamique"
        ),
        "D_stor": "D'",
        "D_loss": "D''",
        "D_comp": "|D*|; D*",
        "J_stor": "J'; shear storage compliance",
        "J_loss": "J''; shear loss compliance",
        "J_comp": "|J*|; J*; complex shear compliance",
        "N_stor": (
            "storage compliance; speicherkomplianz; speichernachgiebigkeit; complaisance de conservation; "
            "complaisance de stockage"
        ),
        "N_loss": "loss compliance; verlustkomplianz; verlustnachgiebigkeit; complaisance de perte",
        "N_comp": (
            "complex compliance; dynamic compliance; komplexe komplianz; komplexe nachgiebigkeit; "
            "complaisance complexe"
        ),
        "E_relax": "E(t); young's relaxation modulus; tensile relaxation modulus",
        "G_relax": (
            "G(t); shear relaxation modulus; schubrelaxationsmodul; module de relaxation en cisaillement"
        ),
        "M_relax": "relaxation modulus; relaxationsmodul; module de relaxation",
        "D_creep": "D(t); tensile creep compliance",
        "J_creep": "J(t); shear creep compliance",
        "N_creep": "creep compliance; kriechkomplianz; kriechnachgiebigkeit; complaisance de fluage",
        "t": (
            "time; time (sequence); test time; elapsed time; zeit; versuchszeit; prüfzeit; messzeit; "
            "temps; temps d'essai"
        ),
        "t_step": (
            "step time; interval time; segment time; time (action); t seg; schrittzeit; abschnittszeit; "
            "temps d'intervalle; durée de l'étape"
        ),
        "M_stress": (
            "stress; stress amplitude; dynamic stress; dyn stress; oscillation stress; spannung; "
            "dyn spannung; spannungsamplitude; contrainte; contrainte dynamique; amplitude de contrainte"
        ),
        "E_stress": "tensile stress; zugspannung; contrainte de traction",
        "G_stress": (
            "shear stress; complex shear stress; schubspannung; scherspannung; contrainte de cisaillement"
        ),
        "tan_del": (
            "tan(delta); tan delta; tan(\u03b4); tan \u03b4; tan d; tan(d); tand; loss factor; "
            "damping factor; verlustfaktor; dämpfungsfaktor; facteur de perte"
        ),
        "delta": (
            "\u03b4; phase; phase angle; phase angle delta; phase angle \u03b4; phase lag; phase shift; "
            "phase difference; loss angle; phasenwinkel; phasenwinkel \u03b4; phasenwinkel delta; "
            "phasenverschiebung; phasenverschiebungswinkel; phasendifferenz; verlustwinkel; angle de phase; "
            "angle de perte; déphasage"
        ),
        "omega": "angular frequency; \u03c9; kreisfrequenz; winkelfrequenz; pulsation; fréquence angulaire",
        "f": "frequency; freq; oscillation frequency; frequenz; prüffrequenz; fréquence",
        "T_surface": "surface temperature; oberflächentemperatur; température de surface",
        "T": "temperature; temp; Ts; sample temperature; temperatur; probentemperatur; température",
        "aT": "shift factor; verschiebungsfaktor; facteur de translation",
        "bT": "vertical shift factor; vertikaler verschiebungsfaktor; facteur de translation verticale",
        "strain": (
            "strain; strain amplitude; strain dyn; dyn strain; dynamic strain; oscillation strain; "
            "shear strain; complex shear strain; tensile strain; dynamic strain amplitude; dehnung; "
            "dyn dehnung; dynamische dehnung; scherung; dehnungsamplitude; deformation; "
            "deformationsamplitude; scherdeformation; déformation; amplitude de déformation"
        ),
        "v": (
            "velocity; sliding velocity; speed; sliding speed; geschwindigkeit; gleitgeschwindigkeit; "
            "vitesse; vitesse de glissement"
        ),
        "v_travel": (
            "travel speed; travelling speed; rolling speed; wheel speed; forward speed; track speed; "
            "vehicle speed; fahrgeschwindigkeit; rollgeschwindigkeit; umfangsgeschwindigkeit; "
            "vitesse de roulement; vitesse d'avancement"
        ),
        "slip_angle": (
            "slip angle; side slip angle; \u03b1; schräglaufwinkel; angle de dérive; angle de glissement"
        ),
        "slip_ratio": (
            "slip ratio; longitudinal slip; slip; \u03ba; kappa; umfangsschlupf; längsschlupf; schlupf; "
            "glissement; taux de glissement; glissement longitudinal"
        ),
        "moment": (
            "mz; m z; aligning moment; aligning torque; self aligning moment; self-aligning moment; "
            "self aligning torque; self-aligning torque; rückstellmoment; moment d'auto-alignement; "
            "couple d'auto-alignement"
        ),
        "F_t": (
            "ft; f t; fx; f x; fy; f y; friction force; tangential force; lateral force; side force; "
            "traction force; horizontal force; brake force; braking force; longitudinal force; "
            "cornering force; reibkraft; reibungskraft; tangentialkraft; seitenkraft; querkraft; "
            "horizontalkraft; bremskraft; umfangskraft; längskraft; force de frottement; force tangentielle; "
            "force latérale; force de freinage; force longitudinale"
        ),
        "F_n": (
            "fn; f n; fz; f z; normal force; normal load; load; vertical force; vertical load; wheel load; "
            "normalkraft; last; normallast; radlast; belastung; vertikalkraft; auflast; force normale; "
            "charge; charge normale"
        ),
        "mu": (
            "friction; friction coefficient; friction coeff; friction factor; coefficient of friction; cof; "
            "mu_visc; side force coefficient; lateral force coefficient; \u03bc; reibwert; reibbeiwert; "
            "reibungskoeffizient; reibungszahl; seitenkraftbeiwert; coefficient de frottement; "
            "coefficient de friction"
        ),
        "p": (
            "pressure; contact pressure; druck; kontaktdruck; anpressdruck; flächenpressung; pression; "
            "pression de contact"
        ),
        "A_over_A0": "contact area; A/A0; kontaktfläche; aire de contact",
        "A": (
            "nominal area; nominal contact area; apparent contact area; contact patch area; nennfläche; "
            "nominelle kontaktfläche; scheinbare kontaktfläche; aire nominale; aire apparente; "
            "surface de contact"
        ),
        "x": (
            "position; distance; sliding distance; displacement; weg; gleitweg; reibweg; verschiebung; "
            "distance de glissement; déplacement"
        ),
        "stroke": "stroke; stroke length; hub; hublänge; schwingweite; course",
        "q": "wavevector; angular wavenumber; wellenvektor; kreiswellenzahl; vecteur d'onde",
        "wavenumber": "wavenumber; wave number; wellenzahl; nombre d'onde",
        "n": "spatial frequency; raumfrequenz; ortsfrequenz; fréquence spatiale",
        "G_d": "Gd; Gd(n); G_d(n); psd gd; psd gd(n); displacement psd",
        "W1": "W1(k)",
        "Wr": "Wr(k)",
        "q_C_iso_over_pi": "q/\u03c0 \u00d7 2d psd",
        "C_1D_surfacetopography": "1d psd along x; 1d psd along y",
    }.items()
}
